"""What is left out of FRFs, or said of them, before modes are looked for."""

import numpy as np
import pytest

from fecore.frf import Dof, FrfSet
from fecore.modal.findings import lines_in_words
from fecore.modal.prepare import screen

HZ = np.arange(20.0, 180.0)
# a resonance at 100 Hz, turned as exp(+iωt) turns it
CLEAN = 1 / ((100.0 + 0.02j * HZ) ** 2 - HZ**2)


def records(count: int) -> FrfSet:
    values = np.linspace(1, 2, count)[:, None] * CLEAN
    return FrfSet(
        HZ, values, tuple(Dof(i + 1, 3) for i in range(count)), (Dof(99, 3),) * count, "receptance"
    )


@pytest.mark.parametrize(
    ("struck", "which"),
    [(1, "1Z/99Z"), (5, ", ".join(f"{i}Z/99Z" for i in range(1, 6))), (6, "5Z/99Z and 1 more")],
)
def test_a_line_that_stands_alone_is_left_out_of_the_records_that_show_it(
    struck: int, which: str
) -> None:
    frfs = records(24)
    frfs.values[:struck, 40] += 50 * np.abs(CLEAN).max()
    found = screen(frfs)
    (said,) = [note for note in found.warnings if "stands alone" in note]
    assert f"{which} (overload or interference)" in said
    np.testing.assert_array_equal(~found.arrangement.measured[:, 40], np.arange(24) < struck)


def test_an_overload_of_one_record_is_left_out_where_all_show_the_mains() -> None:
    frfs = records(8)
    frfs.values[:, 30] += 0.2 * np.abs(CLEAN).max()
    frfs.values[2, 30] += 50 * np.abs(CLEAN).max()
    measured = screen(frfs).arrangement.measured
    np.testing.assert_array_equal(np.flatnonzero(~measured[:, 30]), [2])


@pytest.mark.parametrize(("part", "kept"), [(0.0, 2), (0.7, 2), (2.5, 0)])
def test_frfs_of_exchanged_dofs_may_differ_by_a_session(part: float, kept: int) -> None:
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((2, HZ.size)) @ np.eye(HZ.size)
    other = CLEAN + part * np.linalg.norm(CLEAN) / np.sqrt(2 * HZ.size) * (noise[0] + 1j * noise[1])
    more = records(3)
    frfs = FrfSet(
        HZ,
        np.vstack([CLEAN, other, more.values]),
        (Dof(7, 3), Dof(8, 3), *more.responses),
        (Dof(8, 3), Dof(7, 3), *more.references),
        "receptance",
    )
    found = screen(frfs)
    assert len(found.arrangement.pairs) == 3 + kept
    assert any("by reciprocity; their correlation is 0.8" in note for note in found.warnings) == (
        part == 0.7
    )
    assert len(found.refused) == 2 - kept


def test_lines_are_listed_up_to_four() -> None:
    assert lines_in_words(np.array([1.0, 2.5])) == "1, 2.5 Hz"
    assert lines_in_words(np.arange(1.0, 7.0)) == "1, 2, 3, 4 … 6 Hz (6 lines)"


def test_copies_are_averaged_where_both_were_measured() -> None:
    values = np.array([1.1, 0.9, 1.0])[:, None] * CLEAN
    values[1, :5] = 0
    frfs = FrfSet(HZ, values, (Dof(1, 3), Dof(1, 3), Dof(2, 3)), (Dof(99, 3),) * 3, "receptance")
    found = screen(frfs).arrangement
    np.testing.assert_allclose(
        found.values[0] / CLEAN, np.where(np.arange(HZ.size) < 5, 1.1, 1.0), rtol=1e-12
    )
