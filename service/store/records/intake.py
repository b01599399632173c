"""Time blocks that come one by one from a file that is read as a stream: kept on disk until the hits are known to be whole."""

from __future__ import annotations

import pickle
import tempfile
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np
from sqlalchemy.orm import Session

from modalbase.formats.records import TimeBlock
from service.compute.hits import Place
from service.store.campaigns.operations import campaign_of
from service.store.records.operations import NewRecords, require_new, write_records

Channel = tuple[str, int, int, int, int]
Form = tuple[float, int]
"""Sampling rate and length."""
_NONE = np.empty(0)
_IN_MEMORY = 1 << 20  # bytes of blocks before a file is made: most imports hold none


class RecordIntake:
    """The way of a file's time blocks into a campaign.

    The n-th force block of a place is its n-th hit, and the n-th block of each sensor belongs to it; a block that states no
    place of the force belongs to the force block last seen. Hits go on behind those that the campaign has. A context manager,
    which removes what lies on disk.
    """

    def __init__(self) -> None:
        self._spool = tempfile.SpooledTemporaryFile(_IN_MEMORY, prefix="modalbase-records-")  # noqa: SIM115 - closed by `__exit__`
        self._seen: Counter[Channel] = Counter()
        self._place: Place | None = None
        self._forces: dict[tuple[Place, int], tuple[int, Form]] = {}
        self._others: dict[int, tuple[Place, int, Form]] = {}
        self._mapped: list[TimeBlock] = []

    def __enter__(self) -> RecordIntake:
        return self

    def __exit__(self, *_: object) -> None:
        self._spool.close()

    def take(self, dataset: int, block: TimeBlock) -> str | None:
        """One block of a file; returns why it is of no use, or None."""
        if not (block.point and block.direction):
            return "is a time block without a point and direction"
        if block.quantity == "force":
            self._place = block.point, block.direction
        if block.quantity == "force" or not (block.force_point and block.force_direction):
            if self._place is None:
                return "is a time block that names no force and comes before any force block"
            block = replace(block, force_point=self._place[0], force_direction=self._place[1])
        place = block.force_point, block.force_direction
        channel = (block.quantity, block.point, block.direction, *place)
        self._seen[channel] += 1
        hit, form = self._seen[channel], (block.sample_rate_hz, block.samples.size)
        if block.quantity == "force":
            self._forces[place, hit] = dataset, form
        else:
            self._others[dataset] = place, hit, form
        pickle.dump((dataset, replace(block, hit=hit)), self._spool)
        return None

    def finish(self) -> dict[int, str]:
        """Why a block makes no whole hit, by dataset."""
        refused: dict[int, str] = {}
        answered: set[tuple[Place, int]] = set()
        for dataset, (place, hit, form) in self._others.items():
            _, force = self._forces.get((place, hit), (0, None))
            if force is None:
                refused[dataset] = (
                    f"is a response to hit {hit} at point {place[0]}, of which the file has no force block"
                )
            elif force != form:
                refused[dataset] = (
                    f"has {form[1]} samples at {form[0]:g} Hz, the force of its hit {force[1]} at {force[0]:g} Hz"
                )
            else:
                answered.add((place, hit))
        for (place, hit), (dataset, _) in self._forces.items():
            if (place, hit) not in answered:
                refused[dataset] = f"is the force of hit {hit} at point {place[0]}, of which the file has no response"
        return refused

    def hold(self, block: TimeBlock) -> None:
        """One block whose mapping says where it belongs."""
        pickle.dump((len(self._mapped), block), self._spool)
        self._mapped.append(replace(block, samples=_NONE))

    def store(self, session: Session, new: NewRecords, refused: Collection[int] = ()) -> None:
        """Write the blocks that were not refused, one at a time; `new` says the rest of them.

        Raises:
            Conflict: the campaign has a hit of a stated number there already.
            QuotaExceeded: the project has no room for them.
        """
        campaign_of(session, new.campaign_id, lock=True)  # against a script that sends the same hits
        if not new.counted:
            require_new(session, new.campaign_id, self._mapped)
        held = [*(dataset for dataset, _ in self._forces.values()), *self._others, *range(len(self._mapped))]
        kept = (block for number, block in self._read(len(held)) if number not in refused)
        write_records(session, replace(new, blocks=kept, count=sum(number not in refused for number in held)))

    def _read(self, count: int) -> Iterator[tuple[int, TimeBlock]]:
        self._spool.seek(0)
        for _ in range(count):
            yield pickle.load(self._spool)
