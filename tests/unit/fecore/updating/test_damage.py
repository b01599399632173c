"""A stretch that has lost stiffness is named, though constants soak it up; a sound body is not
accused.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fecore.arrays import FloatArray
from fecore.updating.contradictions import Conflict, _Sources, compare_sources
from fecore.updating.damage import _Given, lost_stiffness
from fecore.updating.damage_effects import DamageEffects
from fecore.updating.elastic import fit_elastic, settled
from fecore.updating.elastic_findings import contradiction
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.forward import ForwardModel
from fecore.updating.layout import Layout
from fecore.updating.parameters import parametrise
from tests.support.damaged import FACTOR, LENGTH, LOST, PARTS, body, measured
from tests.support.lengths import long


@cache
def updated(kind: str, *, damaged: bool) -> ElasticResult:
    measurement, structure = measured(kind, damaged=damaged), body(kind)
    inputs, modes = measurement.inputs, measurement.modes
    assert modes is not None
    prior = parametrise(structure, structure.default_parameters())
    prior = prior.with_inputs(inputs.standard_deviations(structure.nominal))
    highest = float(modes.frequency_hz[-1])
    forward = ForwardModel.of_dofs(prior, modes.dofs, measurement.points, highest, modes=len(modes))
    # The last row is a reference's, at which no shape is known.
    assert modes.shapes is not None
    modes = replace(modes, shapes=modes.shapes[:, :-1], dofs=modes.dofs[:-1])
    return settled(fit_elastic(Layout.of_one(forward, modes, inputs)))


@cache
def conflicts(kind: str) -> tuple[Conflict, ...]:
    """Of the damaged body."""
    return tuple(compare_sources(updated(kind, damaged=True))[0])


@pytest.mark.parametrize("kind", ["strip", long("angle")])
def test_a_sound_body_is_not_said_to_have_lost_stiffness(kind: str) -> None:
    """The evidence is a mean ratio of likelihoods, which of a sound body exceeds 1/p with
    probability p at most.
    """
    (check,) = [
        each
        for each, _ in _Sources.of(updated(kind, damaged=False)).checks
        if each.kind == "stiffness"
    ]
    assert check.p == 1.0


def moved(elastic: ElasticResult, shapes: FloatArray) -> FloatArray:
    """The shapes with points that are met 4 mm off their places, as far in each mode."""
    off = 0.004 * np.random.default_rng(4).standard_normal((shapes.shape[1], 3))
    for row, column in elastic.pairings[0].pairs:
        model = elastic.states[0].shapes[column, : shapes.shape[1]]
        slope = elastic.states[0].slopes[column, : shapes.shape[1]]
        shapes[row] += np.sum(slope * off, axis=1) * (shapes[row] @ model) / (model @ model)
    return shapes


def mixed(_: ElasticResult, shapes: FloatArray) -> FloatArray:
    """The shapes with much of another mode in one of them."""
    shapes[2] += 0.5 * shapes[3] * np.abs(shapes[2]).max() / np.abs(shapes[3]).max()
    return shapes


def poor(_: ElasticResult, shapes: FloatArray) -> FloatArray:
    """The shapes with a fifth of their largest entries as noise."""
    noise = np.random.default_rng(3).standard_normal(shapes.shape)
    return np.asarray(shapes + 0.2 * np.abs(shapes).max(axis=1, keepdims=True) * noise)


@pytest.mark.parametrize("spoilt", [moved, mixed, poor])
def test_what_is_wrong_with_shapes_otherwise_is_no_loss_of_stiffness(
    spoilt: Callable[[ElasticResult, FloatArray], FloatArray],
) -> None:
    elastic = updated("strip", damaged=False)
    (campaign,) = elastic.layout.campaigns
    assert campaign.modes.shapes is not None
    shapes = spoilt(elastic, campaign.modes.shapes.real.copy())
    modes = replace(campaign.modes, shapes=shapes + 0j)
    layout = replace(elastic.layout, campaigns=(replace(campaign, modes=modes),))
    elastic = replace(elastic, layout=layout)
    damage_effects = DamageEffects.of(elastic, 0)
    assert damage_effects is not None
    assert damage_effects.shapes
    assert lost_stiffness(elastic, 0, damage_effects, elastic.problem).evidence < np.log(20)


@pytest.mark.parametrize("kind", ["strip", long("angle")])
def test_a_stretch_that_has_lost_stiffness_is_named_with_its_set_place_and_factor(
    kind: str,
) -> None:
    conflict, *others = conflicts(kind)
    assert not others
    cause = conflict.cause
    assert (cause.kind, cause.name) == ("stiffness", "stiffness of the body")
    (said,) = cause.said
    assert abs(said.rest - FACTOR) < max(3 * said.rest_sd, 0.05)
    of, where = cause.stretch
    assert of == {"strip": "all", "angle": "web"}[kind]
    begin, end, least, most = map(float, re.findall(r"\d+", where))
    first, last = (1e3 * LENGTH[kind] * at / PARTS for at in LOST[kind])
    assert least - 1 < first
    assert last < most + 1
    assert abs(begin - first) < 1e3 * LENGTH[kind] / PARTS + 1
    assert abs(end - last) < 1e3 * LENGTH[kind] / PARTS + 1


def test_the_finding_states_the_level_and_the_verdict_follows() -> None:
    finding = contradiction(conflicts("strip")[0])
    assert finding.level is not None
    assert re.search(
        r"at 0\.\d\d ± 0\.\d\d of it between x = .* of at most 0\.\d % of sound bodies",
        finding.text,
    )


@pytest.mark.parametrize(("places", "ends"), [((3, 2, 2, 1), 2), ((4, 3, 2, 1), 2), ((3, 3, 2), 3)])
def test_the_likeliest_is_followed_until_it_stays_or_twice(
    places: tuple[int, ...], ends: int
) -> None:
    """Each comparison finds its likeliest stretch at the next place."""
    compared = [
        SimpleNamespace(likeliest=place, effects=at, log=at) for at, place in enumerate(places)
    ]
    given: Any = SimpleNamespace(near=lambda at, _: compared[at + 1])
    first: Any = compared[0]
    assert _Given.followed(given, first).likeliest == ends
