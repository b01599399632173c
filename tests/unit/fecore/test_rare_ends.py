"""Ends that fits and judgements seldom come to: too few lines, hits or modes, and what is said of
them.
"""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fecore.body.generators import Piece
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.specimen import LayeredSpecimen, Specimen
from fecore.body.supports import edges
from fecore.dynamics.laws import LAWS, Damped
from fecore.errors import UpdatingError
from fecore.findings import Finding as Remark
from fecore.signal import delay, participation, pulse
from fecore.updating import campaigns, damping_data, damping_stage
from fecore.updating.inputs import Inputs, systematic_effects
from fecore.updating.laws import nearest_positive
from fecore.updating.result import MOST_WARNINGS, warnings
from tests.support.fits import at_prior, forward_model


def test_numbers_of_hits_that_have_little_to_say() -> None:
    size = np.zeros(41)
    size[15:26] = 1 / (1 + np.arange(-5.0, 6.0) ** 2)
    assert [line for line, _ in delay._peaks(size, None)] == [20]
    assert delay._peaks(size, np.ones(41)) == []
    assert participation._strongest(np.zeros((4, 6))) == []
    assert pulse._second(np.ones(50), 10, 5, 45) == (0.0, 0.0, 10)


def test_remarks_beyond_a_dozen_are_counted() -> None:
    many = [Remark("", "", chr(97 + n) * 3, weight=float(-n)) for n in range(MOST_WARNINGS + 2)]
    shown = warnings(many)
    assert (len(shown), shown[-1]) == (MOST_WARNINGS, "3 less important warnings are not listed")


def test_a_law_starts_where_no_mode_is_damped_negatively() -> None:
    law = LAWS["rayleigh"].make(Damped(()))
    assert law is not None
    omega, ratio = np.array([100.0, 200.0]), np.array([0.05, 0.01])
    plain = nearest_positive(law, omega, ratio)
    assert np.all(law.basis(omega) @ plain > 0)
    others = np.array([2000.0])
    assert law.basis(others) @ plain < 0
    assert np.all(law.basis(np.r_[omega, others]) @ nearest_positive(law, omega, ratio, others) > 0)


def test_modes_that_only_move_on_springs_tell_no_damping() -> None:
    frfs: Any = SimpleNamespace(frequency_hz=np.array([1.0, 100.0]), responses=(), references=())
    updated = SimpleNamespace(
        modes=SimpleNamespace(rigid=0),
        frequency_hz=np.array([10.0]),
        on_springs=np.array([True]),
        frf_model=lambda *_: SimpleNamespace(strain=None),
    )
    elastic: Any = SimpleNamespace(
        updated=updated, believed=lambda _: SimpleNamespace(pairs=((0, 0),))
    )
    modes: Any = SimpleNamespace(frequency_hz=np.array([10.0]), damping_ratio=np.array([0.01]))
    with pytest.raises(
        UpdatingError, match="no measured mode strains the specimen: all move on the springs"
    ):
        damping_data.damping_data(frfs, elastic, modes, "noise")


def test_what_campaigns_say_of_one_another() -> None:
    parts: Any = [
        SimpleNamespace(name=name, contradicts=True, predictive_p=0.001, modes=(1, 2, 3))
        for name in "ab"
    ]
    sure = SimpleNamespace(
        probability=lambda rows: np.ones(len(rows)),
        width=lambda rows: np.ones(len(rows)),
        forward=SimpleNamespace(mesh_error=None),
    )
    layout = SimpleNamespace(labels=["Ex"], shared=("Ex",), campaigns=(sure, sure))
    problem = SimpleNamespace(residual=np.array([0.0, 0.0, 1.0]), weights=np.ones(3))
    taken: Any = [(((0, 0), (1, 1)), ()), (((0, 0),), (1, 2))]
    pairings = [SimpleNamespace(pairs=pairs, unpaired_measured=alone) for pairs, alone in taken]
    fitted: Any = SimpleNamespace(
        layout=layout,
        rows=[slice(0, 2), slice(2, 3)],
        pairings=pairings,
        problem=problem,
        rms_residual=lambda rows: float(problem.residual[rows][0]),
        prior_z_score=np.zeros(1),
        admissible_rivals=(),
        rivals=(),
        oscillating_modes=(),
    )
    found = campaigns._findings(fitted, parts)
    assert [(one.level, one.text.split(":")[0]) for one in found] == [
        ("do_not_use", "campaign b"), ("with_care", "campaign b"),
    ]  # fmt: skip
    fitted.pairings[1].unpaired_measured = (1,)
    assert [one.level for one in campaigns._findings(fitted, parts)] == ["with_care", "with_care"]


def test_a_window_that_would_change_nothing_is_not_asked_about() -> None:
    law = SimpleNamespace(coefficient_names=("a0", "a1"))
    damping: Any = SimpleNamespace(
        fit=SimpleNamespace(coefficients=np.array([1.0, 1e-6]), law=law), window=np.zeros(2)
    )
    assert damping_stage.unstated_window(damping, Inputs(), 1.0) == []


FIBRE = OrthotropicMaterial(
    Ex=33e9, Ey=32e9, Gxy=6e9, Gxz=4.5e9, Gyz=4.5e9, nu_xy=0.15, density=2000.0
)


def clamp_shifts(body: Specimen | LayeredSpecimen) -> np.ndarray:
    """Relative shifts of the first frequencies by a clamp that gives way in rotation and in
    translation.
    """
    name = "Ex" if isinstance(body, Specimen) else "E1"
    state = at_prior(forward_model(body, 3, name, reduced=False))
    found = systematic_effects(state, replace(Inputs.exact(), clamp_compliance_sd=0.01), ())
    return np.array([each.shift for each in found])


def test_a_clamp_gives_way_by_the_stiffness_at_the_root() -> None:
    size = (0.5, 0.04, 0.01)
    plain = Specimen(*size, FIBRE, "cantilever", divisions=(20, 2))
    plies = tuple(Ply(FIBRE, 0.005) for _ in range(2))
    layered = LayeredSpecimen(*size, plies, FIBRE.density, "cantilever", divisions=(20, 2))
    # One material, once as plies of itself: the model has another element, whose frequencies differ
    # in the fourth digit.
    # A twist turns no clamp about y: nothing but round-off is left of its shift.
    np.testing.assert_allclose(clamp_shifts(layered), clamp_shifts(plain), rtol=0.01, atol=1e-12)
    # all of it as thick: the same as stated so
    thick = replace(plain, pieces=(Piece(0.0, 0.5, 0.02, 0.02),))
    known = replace(plain, thickness=0.02)
    at_root, everywhere = clamp_shifts(thick)[0], clamp_shifts(known)[0]
    np.testing.assert_allclose(at_root, everywhere, rtol=0.01, atol=1e-12)
    fixed_pairing = replace(plain, supports=edges(start="clamped"))
    assert clamp_shifts(fixed_pairing).size == 0


def test_a_search_on_the_whole_model_needs_no_basis() -> None:
    body = Specimen(0.5, 0.04, 0.01, FIBRE, "cantilever", divisions=(20, 2))
    for reduced in (False, True):
        loose = forward_model(body, 3, "Ex", reduced=reduced).with_unverified_basis()
        assert (loose.like is not None, loose.verified) == (reduced, False)
