"""A backup of a service with jobs that wait, run and were cancelled, restored by the command. `make soak` repeats it."""

from collections import Counter
from pathlib import Path

from benchmarks.soak_backup import restored, soak
from service.app.kinds import KINDS

EVERY_KIND = {kind.name for kind in KINDS}


def test_jobs_of_every_kind_run_to_their_end_in_a_restored_service() -> None:
    tally = soak()
    assert tally.lost == []
    assert {kind for kind, state in tally.before if state == "queued"} == EVERY_KIND
    assert tally.before["update", "running"] == tally.before["update", "cancelling"] == 1
    assert tally.after["update", "cancelled"] == 2


def test_the_jobs_of_a_backup_of_0_2_0_run_to_their_end(short_folder: Path) -> None:
    """`jobs-0.2.0.modalbase` was written by that version, of the service that `keep_waiting` leaves."""
    file = Path(__file__).parents[1] / "integration" / "files" / "jobs-0.2.0.modalbase"
    ended = Counter((job.kind, job.state) for job in restored(file, short_folder / "data"))
    assert {kind for kind, _ in ended} == EVERY_KIND
    assert ended.pop(("update", "cancelled")) == 2
    assert {state for _, state in ended} == {"succeeded"}
