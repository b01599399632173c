"""Damaged files: refused, reported or equal; never a silent change, a hang or a flood of memory."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import uff_damage


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


@pytest.mark.parametrize("kind", uff_damage.FLOODS)
def test_floods_stay_within_bounds(tmp_path: Path, kind: str) -> None:
    memory, _, outcome = uff_damage.flood(uff_damage.FLOODS[kind](), tmp_path / "flood.uff")
    assert "refused" in outcome
    assert memory < 120  # MiB above the start of a process, for files of 20 to 40 MB; pyuff takes 1,800


def test_memory_follows_the_largest_dataset_not_the_file(tmp_path: Path) -> None:
    one = b"".join(uff_damage.encode(uff_damage.sample(1, single=False, even=True), binary=False))
    many = one * (8_000_000 // len(one))
    memory, _, outcome = uff_damage.flood(many, tmp_path / "large.uff")
    assert outcome.count("read: None") > 2_500
    assert memory < 20
