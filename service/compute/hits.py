"""Stored blocks to the core's hits, and judgements to what clients see."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, cast
from uuid import UUID

import numpy as np

from fecore.arrays import FloatArray
from fecore.frf import Dof
from fecore.signal import Block, ChannelQuantity, Hit, HitVerdict

Place = tuple[int, int]
"""Point and direction of a hit."""


@dataclass(frozen=True)
class BlockRow:
    """What is said of a stored block besides its samples."""

    id: UUID
    sha256: bytes
    quantity: str
    point: int
    direction: int
    force_point: int
    force_direction: int
    hit: int
    sample_rate_hz: float
    samples: int
    window_rate_per_s: float
    full_scale: float | None
    dtype: str

    @property
    def place(self) -> Place:
        """Where the hit was."""
        return self.force_point, self.force_direction


def whole(rows: Sequence[BlockRow]) -> tuple[list[BlockRow], list[str]]:
    """The blocks of one place that make whole hits, and a sentence for each hit that lacks its
    force or every response, which is what deleting a block leaves.
    """
    by_hit: dict[int, list[BlockRow]] = {}
    for row in rows:
        by_hit.setdefault(row.hit, []).append(row)
    lacking = {
        number: what for number, blocks in by_hit.items() if (what := _lacks(blocks)) is not None
    }
    sentences = [
        f"hit {n} of point {by_hit[n][0].force_point} has no {lacking[n]}" for n in sorted(lacking)
    ]
    return [row for row in rows if row.hit not in lacking], sentences


def _lacks(blocks: Sequence[BlockRow]) -> str | None:
    forces = sum(row.quantity == "force" for row in blocks)
    return "force" if forces == 0 else "response" if forces == len(blocks) else None


def by_sensors(rows: Sequence[BlockRow]) -> list[list[BlockRow]]:
    """The blocks of the whole hits of one place, parted by where the sensors stood: only hits of
    the same sensors are compared and averaged, as where an accelerometer roves, or one was added.
    """
    sensors: dict[int, set[tuple[int, int]]] = {}
    for row in rows:
        if row.quantity != "force":
            sensors.setdefault(row.hit, set()).add((row.point, row.direction))
    groups: dict[frozenset[tuple[int, int]], list[BlockRow]] = {}
    for row in rows:
        groups.setdefault(frozenset(sensors[row.hit]), []).append(row)
    return list(groups.values())


def hits_of(rows: Sequence[BlockRow], samples: Iterable[FloatArray]) -> list[Hit]:
    """The hits of one place and one set of sensors, from the blocks of `whole` hits."""
    by_hit: dict[int, list[tuple[BlockRow, Block]]] = {}
    for row, values in zip(rows, samples, strict=True):
        dof = Dof(row.point, row.direction)
        quantity = cast("ChannelQuantity", row.quantity)  # the column holds what a mapping let in
        block = Block(dof, quantity, np.asarray(values), row.window_rate_per_s, row.full_scale)
        by_hit.setdefault(row.hit, []).append((row, block))
    hits = []
    for number, blocks in sorted(by_hit.items()):
        (force,) = (b for r, b in blocks if r.quantity == "force")
        responses = sorted((b for r, b in blocks if r.quantity != "force"), key=lambda b: b.dof)
        hits.append(Hit(force, tuple(responses), blocks[0][0].sample_rate_hz, number))
    return hits


def describe_verdict(verdict: HitVerdict) -> dict[str, Any]:
    """A verdict as JSON, the fields of `HitOut`."""
    return {
        "point": verdict.force.point,
        "direction": verdict.force.direction,
        "hit": verdict.number,
        "accepted": verdict.accepted,
        "probability": round(float(verdict.probability), 6),
        "overruled": verdict.overruled,
        "findings": [
            {
                "criterion": f.criterion,
                "number": float(f.number) if np.isfinite(f.number) else None,
                "limit": float(f.limit) if np.isfinite(f.limit) else None,
                "failed": bool(f.failed),
                "sentence": f.sentence,
            }
            for f in verdict.findings
        ],
    }
