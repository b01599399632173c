"""A user's decisions about hits, to the hits that they mean."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from fecore.errors import InputError
from fecore.frf import Dof
from service.compute.hits import Place
from service.store.records.schemas import OverruleIn

_MOST_PLACES = 8  # that a message names


def decisions(overrules: Sequence[OverruleIn], hits: Iterable[tuple[Place, int]]) -> dict[tuple[Dof, int], bool]:
    """Which hits are used, whatever the criteria say.

    Args:
        overrules: as the user stated them; without a direction, the one is meant in which the point was hit.
        hits: place and number of each hit that there is.

    Raises:
        InputError: one means no hit, may mean several, or contradicts another.
    """
    if not overrules:
        return {}
    there = set(hits)
    found: dict[tuple[Dof, int], bool] = {}
    for number, one in enumerate(overrules):
        field, key = f"overrules.{number}", (Dof(one.point, _direction(one, there, number)), one.hit)
        if ((key[0].point, key[0].direction), one.hit) not in there:
            raise InputError(field, f"means {_named(one)}, which there is not; there are {_listed(there)}")
        if found.setdefault(key, one.use) != one.use:
            raise InputError(field, f"contradicts another about {_named(one)}: use it, or leave it out")
    return found


def _direction(one: OverruleIn, there: set[tuple[Place, int]], number: int) -> int:
    """That of the hit which is meant."""
    if one.direction is not None:
        return one.direction
    own = sorted({direction for (point, direction), hit in there if (point, hit) == (one.point, one.hit)})
    if len(own) > 1:
        listed = ", ".join(map(str, own))
        raise InputError(f"overrules.{number}.direction", f"is missing: there is {_named(one)} in directions {listed}")
    return own[0] if own else 3


def _named(one: OverruleIn) -> str:
    way = "" if one.direction is None else f" in direction {one.direction}"
    return f"hit {one.hit} of point {one.point}{way}"


def _listed(there: set[tuple[Place, int]]) -> str:
    numbers: dict[Place, list[int]] = {}
    for place, hit in sorted(there):
        numbers.setdefault(place, []).append(hit)
    found = [
        f"point {point}, direction {direction}: hits {min(own)} to {max(own)}"
        for (point, direction), own in numbers.items()
    ]
    more = f"; and {len(found) - _MOST_PLACES} other places" if len(found) > _MOST_PLACES else ""
    return ("; ".join(found[:_MOST_PLACES]) or "no hits at all") + more
