"""What a fault that pydantic found in a body says to a person: the nearest member there is, a limit with its unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, get_args, get_origin

from pydantic import BaseModel

from service.web.quantities import UNITS, in_words

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
    context = fault.get("ctx", {})
    limit = next((name for name in _LIMITS if name in context), None)
    if limit is None:
        return str(fault["msg"])
    member = next((step for step in reversed(steps) if isinstance(step, str)), "")
    unit = next((unit for end, unit in UNITS.items() if member.endswith(end)), "")
    value = fault["input"]
    said = in_words(value, unit) if isinstance(value, int | float) else str(value)[:40]
    return f"is {said}, expected {_LIMITS[limit]} {in_words(context[limit], unit)}"


def _unknown(kind: Any, steps: Sequence[Any]) -> str:
    """That a model has no such member, and the nearest, which may be within one, as `length_m` is in `geometry`."""
    models = list(_models(kind, steps[:-1]))
    own = {name: name for model in models for name in model.model_fields}
    inner = {
        name: f"{outer}/{name}"
        for model in models
        for outer, field in model.model_fields.items()
        for within in _models(field.annotation, ())
        for name in within.model_fields
    }
    near = _nearest(str(steps[-1]), own, inner)
    what = f"did you mean {near}?" if near else f"there is {', '.join(own)}"
    return f"is no member here; {what}"


def _nearest(name: str, own: Mapping[str, str], inner: Mapping[str, str]) -> str | None:
    """Of members by name: one that says more, as `length_m` and `prior_mean` do, or one that is spelt much the same."""
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
