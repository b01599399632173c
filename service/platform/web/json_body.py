"""Strict reading of JSON bodies: what RFC 8259 allows and PostgreSQL can store, and nothing else.

Python's parser accepts NaN and Infinity, integers of any size, NUL characters and lone surrogates,
each of which would be a server error later; and it keeps the last of a field that is there twice.
Here each is a fault with the pointer to where it stands, in words for a person: the nearest member
that there is, a limit with its unit.
"""

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from itertools import islice
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError

from service.platform.errors import MOST_FAULTS, Fault, Invalid, pointer
from service.platform.web.quantities import UNITS, in_words

_LIMITS = {"gt": "more than", "ge": "at least", "lt": "less than", "le": "at most"}


def wording(fault: Mapping[str, Any], kind: Any, steps: Sequence[Any]) -> str:
    """A fault in words.

    Args:
        fault: as `ValidationError.errors()` lists it.
        kind: annotation of the whole body; None of what is no body.
        steps: from the body to the fault.
    """
    if fault["type"] == "extra_forbidden":
        return _unknown(kind, steps)
    if fault["type"] in ("float_type", "int_type"):
        return _no_number(fault["input"], fault["msg"])
    context = fault.get("ctx", {})
    if isinstance(fault["input"], str) and "max_length" in context:
        return f"has {len(fault['input'])} characters, expected at most {context['max_length']}"
    limit = next((name for name in _LIMITS if name in context), None)
    if limit is None:
        return str(fault["msg"])
    member = next((step for step in reversed(steps) if isinstance(step, str)), "")
    unit = next((unit for end, unit in UNITS.items() if member.endswith(end)), "")
    value = fault["input"]
    shown = in_words(value, unit) if isinstance(value, int | float) else str(value)[:40]
    return f"is {shown}, expected {_LIMITS[limit]} {in_words(context[limit], unit)}"


def _no_number(value: object, usual: str) -> str:
    if isinstance(value, float) and not value.is_integer():
        return f"{usual}, got a number with a fractional part"
    return "Input should be a number" if isinstance(value, str | bool) else usual


def _unknown(kind: Any, steps: Sequence[Any]) -> str:
    """That a model has no such member, and the nearest, which may be within one, as `length_m` is
    in `geometry`.
    """
    models = list(_models(kind, steps[:-1]))
    own = {name: name for model in models for name in model.model_fields}
    inner = {
        name: f"{outer}/{name}"
        for model in models
        # of two that have it the first is named
        for outer, field in reversed(model.model_fields.items())
        for within in _models(field.annotation, ())
        for name in within.model_fields
    }
    near = _nearest(str(steps[-1]), own, inner)
    what = f"did you mean {near}?" if near else f"there is {', '.join(own)}"
    return f"is no member here; {what}"


def _nearest(name: str, own: Mapping[str, str], inner: Mapping[str, str]) -> str | None:
    """Of members by name: one that says more, as `length_m` and `prior_mean` do, or one that is
    spelt much the same.
    """
    for known in (own, inner):
        if longer := [known[one] for one in known if f"_{name}_" in f"_{one}_"]:
            return longer[0]
    for known, alike in ((own, 0.6), (inner, 0.75)):
        if close := get_close_matches(name, known, 1, alike):
            return known[close[0]]
    return None


def _models(kind: Any, steps: Sequence[Any]) -> Iterator[type[BaseModel]]:
    """The models that may stand at a place in a body of an annotation."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        if not steps:
            yield kind
        elif field := kind.model_fields.get(steps[0]):
            yield from _models(field.annotation, steps[1:])
        return
    inner = steps[1:] if get_origin(kind) in (list, tuple, dict) else steps
    for part in get_args(kind):
        yield from _models(part, inner)


INT64 = range(-(2**63), 2**63)
MOST_DEPTH = 64
MOST_MEMBERS = 1000  # of one object
MOST_CHARACTERS = 100_000  # of one text
MOST_VALUES = 50_000  # of an ordinary body
BULK_VALUES = 2_000_000  # of a body that carries measured values

Body = TypeVar("Body")


class _Constant:
    """NaN or an infinity as it stood in the text."""

    def __init__(self, name: str) -> None:
        self.name = name


class _Repeated(dict[str, Any]):
    """An object with a member twice, of which Python would keep the last without a word."""

    def __init__(self, pairs: list[tuple[str, Any]]) -> None:
        super().__init__(pairs)
        self.names = [
            name for name, count in Counter(name for name, _ in pairs).items() if count > 1
        ]


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    return made if len(made) == len(pairs) else _Repeated(pairs)


def refuse_unstorable_text(value: str) -> str:
    """The string itself.

    Raises:
        ValueError: it holds a NUL character or a lone surrogate.
    """
    if fault := _text_fault(value):
        raise ValueError(fault)
    return value


def parse_parameter(name: str, text: str) -> Any:
    """The value of a query parameter that is JSON.

    Raises:
        Invalid: as `parse_json`, naming the parameter.
    """
    try:
        return parse_json(text.encode(errors="replace"))
    except Invalid as error:
        faults = [
            Fault(name + one.pointer, one.detail.removeprefix("the body ")) for one in error.faults
        ]
        raise Invalid(faults, count=error.count) from None


def parse_json(body: bytes, *, most_values: int = MOST_VALUES) -> Any:
    """The value of a JSON body.

    Args:
        body: UTF-8.
        most_values: members and elements that it may have, of all depths together.

    Raises:
        Invalid: the body is not JSON, is larger or deeper than a body may be, or holds a value that
            cannot be stored; the first faults with their pointers.
    """
    # before anything is made of it
    if body.count(b",") + body.count(b"[") + body.count(b"{") > most_values:
        raise Invalid("", f"the body has more than {most_values} values, as many as are read here")
    try:
        value = json.loads(
            body.decode("utf-8"), parse_constant=_Constant, object_pairs_hook=_object
        )
    except UnicodeDecodeError as error:
        raise Invalid("", f"the body is not UTF-8: {error.reason} at byte {error.start}") from None
    except json.JSONDecodeError as error:
        raise Invalid(
            "", f"the body is not JSON: {error.msg} at line {error.lineno}, column {error.colno}"
        ) from None
    except RecursionError:
        raise Invalid("", "the body is nested too deeply") from None
    except ValueError:  # an integer of more digits than Python converts
        raise Invalid(
            "", "the body holds an integer of thousands of digits; the range is that of 64 bits"
        ) from None
    if not _sound(value, MOST_DEPTH):
        raise Invalid(list(islice(_faults(value), MOST_FAULTS + 1)))
    return value


def _sound(value: Any, depth: int) -> bool:
    """Whether nothing in a value is a fault; says it fast, since most bodies are sound."""
    if type(value) is float:
        return math.isfinite(value)
    if type(value) is list:
        return depth > 0 and all(_sound(item, depth - 1) for item in value)
    if type(value) is dict:
        return (
            depth > 0
            and len(value) <= MOST_MEMBERS
            and all(_sound(key, 0) and _sound(item, depth - 1) for key, item in value.items())
        )
    return not isinstance(value, _Repeated) and _scalar_fault(value) is None


def _faults(root: Any) -> Iterator[Fault]:
    """Every value that cannot be stored, in the order of the body; a place is written out only
    where a fault is.
    """
    steps: list[object] = []
    levels: list[Iterator[tuple[object, Any]]] = [iter([("", root)])]
    while levels:
        item = next(levels[-1], None)
        if item is None:
            levels.pop()
            del steps[-1:]
            continue
        step, value = item
        place = steps[1:] if len(levels) == 1 else [*steps[1:], step]
        yield from (Fault(pointer(place), why) for why in _own_faults(value, len(levels)))
        if isinstance(value, dict | list) and len(levels) <= MOST_DEPTH:
            steps.append(step)
            levels.append(iter(value.items() if isinstance(value, dict) else enumerate(value)))


def _own_faults(value: Any, depth: int) -> Iterator[str]:
    """What is wrong with a value, whatever is in it."""
    if isinstance(value, dict | list) and depth > MOST_DEPTH:
        yield f"is nested more than {MOST_DEPTH} deep"
    elif isinstance(value, dict):
        if len(value) > MOST_MEMBERS:
            yield f"has {len(value)} members, at most {MOST_MEMBERS} are read"
        yield from (f"a field's name {fault}" for key in value if (fault := _text_fault(key)))
        if isinstance(value, _Repeated):
            yield from (
                f"the field {name[:100]!r} is there more than once, state it once"
                for name in value.names
            )
    elif not isinstance(value, list) and (fault := _scalar_fault(value)):
        yield fault


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
    if len(value) > MOST_CHARACTERS:
        return f"has {len(value)} characters, at most {MOST_CHARACTERS} are read"
    if "\0" in value:
        return "holds a NUL character"
    try:
        value.encode()
    except UnicodeEncodeError:
        return "holds a lone surrogate"
    return None


def checked(kind: type[Body], value: Any) -> Body:
    """A parsed body as its model.

    Args:
        kind: the model, or a list of models.
        value: what `json.loads` gave.

    Raises:
        Invalid: each of the first faults with its pointer.
    """
    try:
        return TypeAdapter(kind).validate_python(value)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        faults = [
            Fault(pointer(e["loc"]), wording(e, kind, e["loc"])) for e in errors[:MOST_FAULTS]
        ]
        raise Invalid(faults, count=len(errors)) from None
