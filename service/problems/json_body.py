"""Strict reading of JSON bodies: what RFC 8259 allows and PostgreSQL can store, and nothing else.

Python's parser accepts NaN and Infinity, integers of any size, NUL characters and lone surrogates; each would be a
server error later. Here each is a fault with the pointer to where it stands.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

from service.problems.errors import Fault, Invalid

INT64 = range(-(2**63), 2**63)
MOST_FAULTS = 20


class _Constant:
    """NaN or an infinity as it stood in the text."""

    def __init__(self, name: str) -> None:
        self.name = name


def refuse_unstorable_text(value: str) -> str:
    """The string itself.

    Raises:
        ValueError: it holds a NUL character or a lone surrogate.
    """
    if fault := _text_fault(value):
        raise ValueError(fault)
    return value


def parse_json(body: bytes) -> Any:
    """The value of a JSON body.

    Raises:
        Invalid: the body is not JSON, or holds a value that cannot be stored; each fault with its pointer.
    """
    try:
        value = json.loads(body.decode("utf-8"), parse_constant=_Constant)
    except UnicodeDecodeError as error:
        raise Invalid("", f"the body is not UTF-8: {error.reason} at byte {error.start}") from None
    except json.JSONDecodeError as error:
        raise Invalid("", f"the body is not JSON: {error.msg} at line {error.lineno}, column {error.colno}") from None
    except RecursionError:
        raise Invalid("", "the body is nested too deeply") from None
    except ValueError:  # an integer of more digits than Python converts
        raise Invalid("", "the body holds an integer of thousands of digits; the range is that of 64 bits") from None
    faults = [fault for fault, _ in zip(_faults(value), range(MOST_FAULTS), strict=False)]
    if faults:
        raise Invalid(faults)
    return value


def _faults(root: Any) -> Iterator[Fault]:
    """Every value that cannot be stored; iterative, since the depth is the client's choice."""
    waiting: list[tuple[str, Any]] = [("", root)]
    while waiting:
        pointer, value = waiting.pop()
        if isinstance(value, dict):
            for key, item in value.items():
                if fault := _text_fault(key):
                    yield Fault(pointer, f"a field's name {fault}")
                waiting.append((f"{pointer}/{escape(key)}", item))
        elif isinstance(value, list):
            waiting.extend((f"{pointer}/{i}", item) for i, item in enumerate(value))
        elif fault := _scalar_fault(value):
            yield Fault(pointer, fault)


def _scalar_fault(value: Any) -> str | None:
    if isinstance(value, str):
        return _text_fault(value)
    if isinstance(value, _Constant):
        return f"is {value.name}, expected a finite number"
    if isinstance(value, float) and not math.isfinite(value):
        return "is beyond the range of double precision, expected a finite number"
    if isinstance(value, int) and value not in INT64:
        return "is beyond the range of 64-bit integers"
    return None


def _text_fault(value: str) -> str | None:
    if "\0" in value:
        return "holds a NUL character"
    try:
        value.encode()
    except UnicodeEncodeError:
        return "holds a lone surrogate"
    return None


def escape(token: object) -> str:
    """One step of a JSON pointer, escaped as RFC 6901 wants it; safe to print."""
    text = str(token).encode("utf-8", "replace").decode("utf-8")
    return text.replace("~", "~0").replace("/", "~1")
