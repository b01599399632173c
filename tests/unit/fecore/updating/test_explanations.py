"""What a body may have that nobody stated: as exact as a model with it, and named with its size."""

from dataclasses import replace

import numpy as np
import pytest

from fecore.arrays import FloatArray
from fecore.body.constants import DEFAULT_PARAMETERS
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass, Spring, edges
from fecore.frf import along_z
from fecore.modes import MeasuredModes
from fecore.updating import contradictions, suspects
from fecore.updating.additions import Addition, AlteredForward, effect_of
from fecore.updating.contradictions import _Sources, compare_sources
from fecore.updating.elastic import fit_elastic, settled
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.layout import Layout
from fecore.updating.parameters import parametrise
from fecore.updating.suspects import SupportEffect
from tests.support import soft_supports
from tests.support.lengths import long

MATERIAL = OrthotropicMaterial(
    Ex=30e9, Ey=10e9, Gxy=4e9, Gxz=4e9, Gyz=3e9, nu_xy=0.25, density=1900.0
)
CANTILEVER = Specimen(0.3, 0.03, 0.004, MATERIAL, divisions=(16, 3))
FREE = replace(CANTILEVER, boundary="free")
CLAMPED = replace(FREE, supports=edges("clamped", "clamped"))
COUNT = 6


def forward_of(body: Specimen) -> ForwardModel:
    points = np.array([[0.1, 0.0], [0.2, 0.01], [0.3, -0.01]])
    return ForwardModel(body, parametrise(body), along_z([1, 2, 3]), points, COUNT + 8)


def elastic_hz(body: Specimen) -> FloatArray:
    forward = forward_of(body)
    return forward.solve(forward.parametrisation.prior_mean).frequency_hz[:COUNT]


def altered_hz(body: Specimen, addition: Addition, size: float) -> FloatArray:
    altered = AlteredForward.of(forward_of(body), [addition])
    theta = altered.parametrisation.prior_mean.copy()
    theta[-1] = size
    return altered.solve(theta).frequency_hz[:COUNT]


def additions(body: Specimen, kind: str) -> list[Addition]:
    forward = forward_of(body)
    state = forward.solve(forward.parametrisation.prior_mean)
    return {
        "mass": lambda: suspects.masses(state),
        "foot": lambda: suspects.feet(state, COUNT),
        "support": lambda: suspects.supports(state, COUNT),
    }[kind]()


def test_a_support_that_gives_way_is_that_of_a_hinge_with_a_spring() -> None:
    """EI/kL = 0.4, far from a firm one: the modes of bending, as a hinge lets the edge warp in
    torsion, a block does not.
    """
    k = 40.0
    (about_y,) = (each for each in additions(CANTILEVER, "support") if each.name == "support_ry")
    hinged = replace(
        CANTILEVER,
        supports=edges("simply_supported"),
        springs=(Spring("root", k / 0.03, 5, edge="start"),),
    )
    bending = [0, 1, 3, 4]
    assert altered_hz(CANTILEVER, about_y, k)[bending] == pytest.approx(
        elastic_hz(hinged)[bending], rel=2e-3
    )
    assert altered_hz(CANTILEVER, about_y, 1e7) == pytest.approx(elastic_hz(CANTILEVER), rel=1e-3)


@pytest.mark.parametrize("body", [CANTILEVER, FREE])
def test_a_mass_is_that_of_a_body_which_carries_it(body: Specimen) -> None:
    addition = additions(body, "mass")[7]
    carrying = replace(body, masses=(PointMass(*addition.place[:2], 0.02),))
    assert altered_hz(body, addition, 0.02) == pytest.approx(elastic_hz(carrying), rel=1e-3)


def test_a_foot_is_a_spring_along_the_end() -> None:
    """A strip that it lets rock about itself: what was a rigid motion is a mode."""
    (foot,) = (each for each in additions(FREE, "foot") if each.along_an_end and each.place[0] == 0)
    on_foot = replace(FREE, springs=(Spring("foot", 2e4 / 0.03, 3, edge="start"),))
    assert altered_hz(FREE, foot, 2e4) == pytest.approx(elastic_hz(on_foot), rel=3e-2)


@pytest.mark.parametrize(("body", "kind"), [(FREE, "mass"), (FREE, "foot")])
def test_screening_has_the_changes_and_derivatives_of_altered_bodies(
    body: Specimen, kind: str
) -> None:
    addition = additions(body, kind)[-1]
    forward = forward_of(body)
    state = forward.solve(forward.parametrisation.prior_mean)
    effect, usual = effect_of(state, [addition]), np.array([addition.usual])
    change, by = effect.at(usual)
    there = altered_hz(body, addition, float(usual[0]))
    if kind != "foot":  # which lets a mode of the rigid body in
        assert np.sort(change[:COUNT, 0] + np.log(state.frequency_hz[:COUNT])) == pytest.approx(
            np.log(there), abs=2e-3
        )
    step = 1e-3 * usual
    slope = (effect.at(usual + step)[0] - effect.at(usual - step)[0]) / (2 * step)
    assert by[:COUNT] == pytest.approx(slope[:COUNT], rel=1e-3, abs=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("body", [CANTILEVER, CLAMPED])
def test_supports_are_screened_as_altered_bodies_have_them(body: Specimen) -> None:
    """All that a body has give way at once, by usual compliances."""
    supports = additions(body, "support")
    forward = forward_of(body)
    state = forward.solve(forward.parametrisation.prior_mean)
    usual = np.array([each.usual for each in supports])
    change, shapes = SupportEffect.of(state, supports).at(usual[None])
    altered = AlteredForward.of(forward, supports)
    theta = altered.parametrisation.prior_mean.copy()
    theta[-len(supports) :] = 1 / usual
    there = altered.solve(theta)
    assert np.sort(change[:COUNT, 0] + np.log(state.frequency_hz[:COUNT])) == pytest.approx(
        np.log(there.frequency_hz[:COUNT]), abs=1e-3
    )
    alike = [
        abs(a @ b) / np.linalg.norm(a) / np.linalg.norm(b)
        for a, b in zip(shapes[0], there.shapes, strict=False)
    ]
    assert min(alike[:4]) > 0.999  # the next two are close, and mix


def test_one_of_two_supports_gives_way_as_a_hinge_with_a_spring() -> None:
    """The other one resists it."""
    (about_y,) = (each for each in additions(CLAMPED, "support") if each.name == "support_2_ry")
    assert about_y.place == (0.3, 0.0, 0.0)
    hinged = replace(
        CLAMPED,
        supports=edges("clamped", "simply_supported"),
        springs=(Spring("end", 40 / 0.03, 5, edge="end"),),
    )
    bending = [0, 1, 3, 5]
    assert altered_hz(CLAMPED, about_y, 40.0)[bending] == pytest.approx(
        elastic_hz(hinged)[bending], rel=1e-3
    )


@pytest.mark.parametrize(
    ("kind", "name"), [("root", "support of the body"), long("foot", "foot under the body")]
)
def test_a_soft_support_of_solids_is_named_with_its_stiffness(kind: str, name: str) -> None:
    """Without it Ex is a fifth off, and a mass would be blamed."""
    modes, points = soft_supports.measured(kind)
    body = soft_supports.stated(kind)
    prior = parametrise(body, DEFAULT_PARAMETERS).with_inputs(
        Inputs().standard_deviations(body.nominal)
    )
    forward = ForwardModel.of_dofs(
        prior, modes.dofs, points, 1.05 * float(modes.frequency_hz[-1]), len(modes)
    )
    conflict, *others = compare_sources(
        settled(fit_elastic(Layout.of_one(forward, modes, Inputs())))
    )[0]
    assert conflict.cause.name == name
    assert not any(
        each.kind in ("mass", "foot", "support")
        for each in (*conflict.rivals, *(c.cause for c in others))
    )
    assert conflict.odds is not None
    assert conflict.odds > np.log(20.0)
    assert conflict.cause.said[0].rest == pytest.approx(soft_supports.STIFFNESS[kind], rel=0.25)
    assert conflict.moved > 3


def test_a_soft_root_that_constants_take_up_is_weighed_by_a_fit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of moduli stated at 55 % three frequencies, without shapes, say little of a root of EI/kL =
    0.27 where constants follow linearly, ln B = 6, and enough, 12, where they are fitted. What
    explains takes the same fit.
    """
    monkeypatch.setattr(contradictions, "FALSE_ALARMS", 1e-3)  # of which ln B = 8.7 is enough
    (about_y,) = (each for each in additions(CANTILEVER, "support") if each.name == "support_ry")
    hz = altered_hz(CANTILEVER, about_y, 60.0)[:3]
    covariance = np.diag(np.r_[(1e-3 * hz) ** 2, np.full(3, 1e-8)])
    modes = MeasuredModes(hz, np.full(3, 0.01), covariance=covariance)
    low = {name: 0.55 * getattr(MATERIAL, name) for name in ("Ex", "Ey", "Gxy")}
    stated = replace(CANTILEVER, material=replace(MATERIAL, **low))
    inputs = Inputs().standard_deviations(stated.nominal)
    forward = replace(
        forward_of(stated),
        parametrisation=parametrise(stated, DEFAULT_PARAMETERS).with_inputs(inputs),
    )
    elastic = settled(fit_elastic(Layout.of_one(forward, modes, Inputs())))
    sources = _Sources.of(elastic)
    (check,) = (each for each, _ in sources.checks if each.kind == "support")
    supports, hint = sources._hints[0]["support"]
    assert 0 < hint.evidence < 8
    assert check.evidence > 10
    fitted = sources._searches[0].of_supports(supports)
    assert fitted is not None
    assert check.evidence == fitted.evidence - hint.stated
    ((_, stiffness, sd), *_) = fitted.sizes
    assert abs(stiffness - 60.0) < 3 * sd < 10.0
