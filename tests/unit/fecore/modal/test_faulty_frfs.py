"""FRFs with faults: what identification leaves out, names or refuses."""

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.made_frfs import KINDS
from fecore.correlation import mac
from fecore.errors import IdentificationError, InputError
from fecore.frf import Dof, FrfSet
from fecore.modal import identify, set_with_gaps
from fecore.modal.prepare import screen
from tests.support.beams import LINES, PAPER_HZ, PAPER_ZETA, assert_papers_modes, paper_frfs
from tests.support.lengths import long


@pytest.fixture(scope="module")
def good() -> FrfSet:
    """FRFs that the tests spoil: line k is at 2 (k + 1) Hz, row r is 33Z/(r + 1)Z."""
    return paper_frfs(0.01, 6, LINES)


def test_what_was_not_measured_is_left_out_and_told(good: FrfSet) -> None:
    """A line at zero, a dead channel, an overload, lines that are missing from one FRF and from
    all; and the driving point has the wrong sign.
    """
    values = good.values.copy()
    values[7] = 0
    values[5, 124] = 1e4
    values[3, 195:200] = np.nan
    values[:, 25] = np.nan
    values[32] *= -1
    values = np.concatenate([np.full((33, 1), 7.0), values], axis=1)
    found = identify(
        set_with_gaps(np.append(0.0, good.frequency_hz), values, good.responses, good.references)
    )
    assert [r.frf for r in found.refused] == ["33Z/8Z"]
    assert "dead channel" in found.refused[0].reason
    assert len(found.modes) == 5
    assert np.allclose(found.modes.frequency_hz, PAPER_HZ, rtol=1e-3)
    assert np.allclose(found.modes.damping_ratio, PAPER_ZETA, rtol=0.01)
    assert Dof(8, 3) not in found.modes.dofs
    assert any("33Z/8Z" in w for w in found.warnings)
    assert any("250 Hz" in w and "33Z/6Z" in w for w in found.warnings)
    assert any("line at 0 Hz" in w for w in found.warnings)
    assert any("33Z/33Z" in w and "sign" in w for w in found.warnings)


def test_wrong_signs_and_zeroes_are_left_out_and_named(good: FrfSet) -> None:
    """As large as their neighbours, so that only the fit sees them; of ten FRFs, each at another
    line. One of them has zeroes for a gap.
    """
    values = good.values.copy()
    rows, lines = np.arange(3, 13), 109 + 8 * np.arange(10)
    values[rows, lines] *= -1
    values[3, 195:200] = 0
    found = identify(replace(good, values=values))
    assert_papers_modes(found, 1e-3, 0.01)
    said = "left out, far off what the other lines say"
    wrong = {
        f"33Z/{row + 1}Z: {2 * line + 2} Hz {said}" for row, line in zip(rows, lines, strict=True)
    }
    named = {w for w in found.warnings if w.endswith(said)}
    assert named <= wrong
    assert len(named) >= 3  # near an antiresonance both signs are as good
    assert any("33Z/4Z" in w and "392" in w and "not measured" in w for w in found.warnings)


def test_a_line_saturated_in_all_channels_and_interference_are_no_modes(good: FrfSet) -> None:
    values = good.values.copy()
    values[:, 124] *= 300 * np.exp(1j * np.random.default_rng(1).uniform(0, 6.28, 33))
    values[:, 24] += 3 * np.abs(values[:, 24]).max()
    found = identify(replace(good, values=values))
    assert_papers_modes(found, 1e-3, 0.01)
    assert any("250 Hz" in w for w in found.warnings)
    assert any("interference at 50" in w for w in found.warnings)


def test_repeats_that_agree_are_averaged_and_others_refused(good: FrfSet) -> None:
    """The first once more, the second once more in the opposite direction, the third once more with
    the wrong sign.
    """
    again = paper_frfs(0.01, 7, LINES)
    repeated = FrfSet(
        good.frequency_hz,
        np.vstack([good.values, again.values[:1], -again.values[1:3]]),
        (*good.responses, *good.responses[:3]),
        (*good.references, good.references[0], Dof(2, -3), good.references[2]),
    )
    found = identify(repeated)
    assert len(found.modes) == 5
    assert len(found.used) == 32
    for frf in ("33Z/1Z", "33Z/2Z"):
        assert any(frf in w and "averaged" in w for w in found.warnings)
    assert {r.frf for r in found.refused} == {"33Z/3Z"}
    assert "opposite signs" in found.refused[0].reason
    assert {Dof(p, 3) for p in (1, 2, 3)} - set(found.modes.dofs) == {Dof(3, 3)}


def test_sets_of_repeats_that_all_contradict_one_another_and_of_two_quantities(
    good: FrfSet,
) -> None:
    with pytest.raises(
        IdentificationError, match=r"all FRFs contradict their repeats: .*opposite signs"
    ):
        screen([good, replace(good, values=-good.values)])
    with pytest.raises(
        IdentificationError,
        match=r"stated as the same FRF and differ \(correlation 0\.\d\d\): correct the points",
    ):
        screen([good, replace(good, values=good.values[:, ::-1])])
    constant = np.where(np.arange(33)[:, None] == 4, 2 + 1j, good.values)
    found = screen([replace(good, values=constant)])
    assert [r.reason for r in found.refused] == [
        "is the same number at all lines: not a measurement"
    ]
    mixed = [good.select(list(range(10))), good.select(list(range(10, 33))).to_quantity("mobility")]
    assert (
        "the FRFs are of different quantities: all were taken as accelerance"
        in screen(mixed).warnings
    )


def test_frequency_axes_may_differ_within_a_campaign(good: FrfSet) -> None:
    fine = paper_frfs(0.01, 7, lines=2 * LINES)
    first, second = good.select(list(range(20))), fine.select(list(range(20, 33))).band(10.0, 950.0)
    found = identify([first, second])
    assert_papers_modes(found, 1e-3, 0.01)
    assert any("2 different frequency axes" in w for w in found.warnings)


@pytest.mark.parametrize(
    ("factor", "largest"), [(1e300, "e+30"), (1e-300, "e-29"), (1e304, "e+30")]
)
def test_values_whose_squares_leave_double_precision_are_no_frfs(
    good: FrfSet, factor: float, largest: str
) -> None:
    with pytest.raises(InputError, match=r"check unit and scale") as refused:
        replace(good, values=factor * good.values)
    assert largest in str(refused.value)
    assert "reference point" in str(refused.value)


def test_an_frf_of_quite_another_scale_is_named_with_the_one_it_is_judged_by(good: FrfSet) -> None:
    faint, loud = good.values.copy(), good.values.copy()
    faint[7] *= 1e-300
    loud[7] *= 1e60
    (refused,) = identify(replace(good, values=faint)).refused
    assert refused.frf == "33Z/8Z"
    assert re.match(r"is at most \S+e-\d{3} where 33Z/\d+Z reaches", refused.reason)
    assert "the scale of one of the two is wrong" in refused.reason
    (refused,) = screen(replace(good, values=loud)).refused
    assert refused.frf == "33Z/8Z"
    assert re.match(r"is \S+e\+\d\d times as large as most FRFs: another unit", refused.reason)


def test_modal_constants_tell_that_all_frfs_are_another_quantity() -> None:
    frfs = paper_frfs(0.01, 0)
    pairs = zip(frfs.responses, frfs.references, strict=True)
    right = frfs.select([row for row, (a, b) in enumerate(pairs) if a.point != b.point])
    wrong = replace(right.to_quantity("receptance"), quantity="accelerance")
    kinds = [[each.kind for each in identify(frfs).notes] for frfs in (right, wrong)]
    assert [each.count("quantity_of_all") for each in kinds] == [0, 1]


@pytest.mark.parametrize("fault", ["noise", long("half")])
def test_one_frf_that_says_nothing_takes_no_mode_from_the_others(fault: str) -> None:
    """It is noise thirty times as large as itself, or was measured to the middle of the band: then its own part
    of the shapes is not known, and the others are as without it.
    """
    draw, row = KINDS["beam"](4), 3
    values, rng = draw.frfs.values.copy(), np.random.default_rng(1)
    if fault == "noise":
        noise = rng.standard_normal((2, values.shape[1])) * np.sqrt(
            np.mean(np.abs(values[row]) ** 2)
        )
        values[row] += 30 * (noise[0] + 1j * noise[1])
    else:
        values[row, values.shape[1] // 2 :] = 0
    whole, spoilt = (
        identify(frfs).found.modes for frfs in (draw.frfs, replace(draw.frfs, values=values))
    )
    assert spoilt.probability.min() > 0.9
    np.testing.assert_allclose(spoilt.frequency_hz, whole.frequency_hz, rtol=1e-3)
    high = slice(None) if fault == "noise" else whole.frequency_hz > draw.frfs.frequency_hz.mean()
    other = np.arange(len(whole.dofs)) != row
    for one, before in zip(spoilt.shapes[high], whole.shapes[high], strict=True):
        assert mac(one[other, None], before[other, None])[0, 0] > 0.99
        assert np.abs(one).argmax() != row
