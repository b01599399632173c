"""Documents on their way into the database: JSON, which has no NaN and no Infinity."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

from service.errors import NotFinite

MOST_PLACES = 3  # that a message names


def dumps(document: Any) -> str:
    """A document as JSON, for every column that holds one.

    Raises:
        NotFinite: a number is NaN or infinite; names the first places.
    """
    try:
        return json.dumps(document, allow_nan=False)
    except ValueError:
        places = [place for place, _ in zip(_not_finite(document, ""), range(MOST_PLACES), strict=False)]
        raise NotFinite(places) from None


def _not_finite(value: Any, at: str) -> Iterator[str]:
    if isinstance(value, float):
        if not math.isfinite(value):
            yield at
        return
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list | tuple) else ()
    for key, member in inside:
        yield from _not_finite(member, f"{at}/{key}")
