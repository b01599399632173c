"""Damaged files: refused, reported or equal; never a silent change, a hang or a flood of memory."""

from pathlib import Path

import numpy as np

from benchmarks import uff_damage
from modalbase.formats.uff import Axis, Frf, Limits


def test_no_silent_change(tmp_path: Path) -> None:
    table, _, silent = uff_damage.run(150, 1, tmp_path)
    assert [(name, kind) for name, kind, _ in silent] == []
    assert sum(counts.total() for counts in table.values()) == 150
    assert all(counts for counts in table.values())


def test_the_verdict_knows_a_silent_change(tmp_path: Path) -> None:
    """The judge is judged: two changed ordinates without a word, or a lost dataset, do not pass."""
    path = tmp_path / "file.uff"
    data = uff_damage.originals()["text double even"]
    path.write_bytes(data)
    sound, damaged = uff_damage.load(path), uff_damage.load(path)
    frf = damaged.contents[3][0]
    frf.values[:2] += 1
    assert uff_damage.judge(sound, damaged, "byte flip") == "SILENT CHANGE"
    frf.values[:2] -= 1
    damaged.reports.pop()
    damaged.contents.pop()
    assert uff_damage.judge(sound, damaged, "byte flip") == "SILENT CHANGE"


def test_floods_stay_within_bounds(tmp_path: Path) -> None:
    """Of 20 to 40 MB each; a tenth of the datasets that are taken, and so of the memory: pyuff takes 1,800 MiB."""
    assert Limits().datasets == 200_000
    files = {kind: flood() for kind, flood in uff_damage.FLOODS.items()}
    for kind, (memory, _, outcome) in uff_damage.flood(files, tmp_path, most=20_000).items():
        assert "refused" in outcome, kind
        assert memory < (12 if "empty datasets" in kind else 120), kind


def test_memory_follows_the_largest_dataset_not_the_file(tmp_path: Path) -> None:
    axis = Axis(0.5, 0.5, 10_000)
    frf = Frf(
        0, "FRF 1Z/1Z", ("beam", "", "", "", ""), 1, 3, 1, -3, "accelerance", axis, np.ones(10_000, dtype=complex)
    )
    many = b"".join(uff_damage.encode([frf] * 100, binary=True))
    memory, _, outcome = uff_damage.flood({"16 MB": many}, tmp_path)["16 MB"]
    assert outcome.count("read: None") == 101  # with the units
    assert memory < 10  # 3; 17 where the contents are kept
