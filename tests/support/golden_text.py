"""Golden documents as text: a line for each member, objects of a list as columns, so that a change
shows what it changes.

    parameters[]
     name ["Ex","Gxy"]
     estimate [3.17e10,6.38e9]

A long array is `~[count,root mean square,[first,middle,last]]` and how many are missing. What is
empty or masked has no line; `members.txt` names all members of all documents, `sentences.txt` all
long sentences.
"""

import json
import re
from collections.abc import Iterator
from typing import Any

ABSENT = "~"
SAMPLE = ("numbers", "rms", "some", "missing")
WIDE = 110
KNOWN = 90  # characters of a sentence in the list of all
LONG = 48  # characters of a sentence, above which a document has its beginning
ONCE = {"provenance", "advice", "description", "warnings", "reasons"}
"""Members of which a document has no line: their sentences are in the list of all of them."""
_MASK = re.compile("<[a-z]+>")


def columns(value: Any) -> Any:
    """A document whose lists of objects are objects of lists."""
    if not isinstance(value, dict):
        return value
    return {
        **{name: columns(each) for name, each in value.items() if not _objects(each)},
        **{f"{name}[]": _table(each) for name, each in value.items() if _objects(each)},
    }


def _objects(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(each, dict) for each in value)


def _table(rows: list[Any]) -> dict[str, Any]:
    rows = [columns(row) if isinstance(row, dict) else {} for row in rows]
    table = {}
    for name in dict.fromkeys(name for row in rows for name in row):
        column = [row.get(name, ABSENT) for row in rows]
        table[name] = _table(column) if any(isinstance(each, dict) for each in column) else column
    return table


def empty(value: Any) -> bool:
    """Whether a member has no line."""
    if isinstance(value, dict):
        return all(empty(each) for each in value.values())
    if isinstance(value, list):
        return all(each == ABSENT or empty(each) for each in value)
    return (
        value is None
        or value is False
        or (isinstance(value, str) and (not value or _MASK.fullmatch(value) is not None))
    )


def _sample(value: dict[str, Any]) -> bool:
    return "rms" in value or value.keys() >= {"items", "each"}


def members(value: Any, place: str) -> Iterator[str]:
    """The places of all members, with and without a value."""
    yield place
    for name, each in value.items() if isinstance(value, dict) and not _sample(value) else ():
        yield from members(each, f"{place}/{name}")


def tree(places: set[str]) -> str:
    """Places as lines, each below what it is a member of."""
    parts = sorted(place.split("/") for place in places)
    return "".join(f"{' ' * (len(part) - 1)}{part[-1]}\n" for part in parts)


def places(text: str) -> set[str]:
    """The places of such lines."""
    found, above = set(), list[str]()
    for line in text.splitlines():
        above = [*above[: _depth(line)], line.strip()]
        found.add("/".join(above))
    return found


def shortened(value: Any, sentences: set[str]) -> Any:
    """A document with the beginnings of its long sentences, which are added to `sentences`."""
    if isinstance(value, dict):
        found = {name: shortened(each, sentences) for name, each in value.items()}
        return {name: _unsaid(each) if name in ONCE else each for name, each in found.items()}
    if isinstance(value, list):
        return [shortened(each, sentences) for each in value]
    if not isinstance(value, str) or len(value) <= LONG:
        return value
    sentences.add(value[:KNOWN])
    return f"{value[:LONG].rpartition(' ')[0] or value[:LONG]} …"


def _unsaid(value: Any) -> Any:
    """A sentence, or a column of them, without its line."""
    if isinstance(value, list):
        return [_unsaid(each) for each in value]
    return None if isinstance(value, str) else value


def written(value: dict[str, Any], indent: str = "") -> Iterator[str]:
    """The lines of a document in columns."""
    for name, each in value.items():
        if empty(each):
            continue
        head = f"{indent}{name.replace(' ', '·')}"
        if isinstance(each, dict) and "rms" in each and not isinstance(each["rms"], list):
            yield f"{head} ~{_json([each[part] for part in SAMPLE if each.get(part) is not None])}"
        elif isinstance(each, dict):
            yield head
            yield from written(each, f"{indent} ")
        elif (
            isinstance(each, list) and len(line := f"{head} {_json(each)}") > WIDE and _wraps(each)
        ):
            yield head + " -"
            yield from (f"{indent} {_json(part)}" for part in each)
        else:
            yield line if isinstance(each, list) else f"{head} {_json(each)}"


def _wraps(values: list[Any]) -> bool:
    return any(
        isinstance(each, list) or (isinstance(each, str) and len(each) > 12) for each in values
    )


def _json(value: Any) -> str:
    if isinstance(value, list):
        return f"[{','.join(_json(each) for each in value)}]"
    if isinstance(value, float):
        mantissa, exponent = f"{value:.11e}".split("e")
        scientific = f"{mantissa.rstrip('0').rstrip('.')}e{int(exponent)}"
        return min(f"{value + 0.0:.12g}".replace("e+", "e"), scientific, key=len) if value else "0"
    return json.dumps(value, ensure_ascii=False)


def read(text: str) -> dict[str, Any]:
    """The document of `written` lines."""
    lines, at = text.splitlines(), 0

    def block(depth: int) -> dict[str, Any]:
        nonlocal at
        found: dict[str, Any] = {}
        while at < len(lines) and _depth(lines[at]) == depth:
            name, _, rest = lines[at].strip().partition(" ")
            at += 1
            name = name.replace("·", " ")
            if rest == "-":
                found[name] = []
                while at < len(lines) and _depth(lines[at]) == depth + 1:
                    found[name].append(json.loads(lines[at]))
                    at += 1
            else:
                sample = (
                    dict(zip(SAMPLE, json.loads(rest[1:]), strict=False))
                    if rest.startswith("~")
                    else None
                )
                found[name] = sample or (json.loads(rest) if rest else block(depth + 1))
        return found

    return block(0)


def _depth(line: str) -> int:
    return len(line) - len(line.lstrip(" "))
