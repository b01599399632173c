"""What the OpenAPI document promises, as text, and what of a change breaks what relies on it.

    GET /api/v1/projects
     limit?:integer=100
     200 :Page_ProjectOut_
    = Page_ProjectOut_
     items:[ProjectOut]

`?` follows what may be left out, `=` what it is then; `<` begins the body; before a `:` stands a
media type that is not
JSON. Types are alternatives: JSON's, constants, `[of a list]`, `{of an object's values}`, schemas
by name. Schemas are compared by what they hold, so that a new name of one breaks nothing. Limits
and descriptions are left out.
"""

import json
import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from tests.support.golden import DATA, WRITE

FILE = DATA / "contract.txt"
COMMAND = f"{WRITE}=write .venv/bin/python -m pytest tests/golden -k openapi -s"
Node = dict[str, Any]
METHODS = ("get", "post", "put", "patch", "delete")
ANY = "any"
JSON = "application/json"
REFUSED, PROBLEM = "422", "application/problem+json"
"""An answer that each operation has, and the media type of the one schema of problems."""
FORMATS = {"date-time": "time", "uuid": "id", "binary": "bytes"}
"""Strings that are more than a string."""
ID = re.compile(r"\{(\w+)\}")


@dataclass(frozen=True, kw_only=True)
class Member:
    """A parameter, or a member of a schema."""

    types: frozenset[str]
    required: bool
    default: str | None = None


@dataclass
class Operation:
    """A method of a path: parameters as `query limit`, types of the body and of answers by media
    type.
    """

    parameters: dict[str, Member] = field(default_factory=dict)
    body: dict[str, frozenset[str]] = field(default_factory=dict)
    body_required: bool = False
    answers: dict[str, dict[str, frozenset[str]]] = field(default_factory=dict)


class Contract:
    """Operations and schemas of an OpenAPI document."""

    def __init__(self, document: Node) -> None:
        self.operations: dict[str, Operation] = {}
        self.schemas: dict[str, dict[str, Member]] = {}
        self._components = document.get("components", {}).get("schemas", {})
        for path, methods in document["paths"].items():
            for method in METHODS:
                if method in methods:
                    self._add(f"{method.upper()} {path}", methods[method])

    def _add(self, name: str, stated: Node) -> None:
        made = self.operations[name] = Operation()
        for one in stated.get("parameters", []):
            where = f"{one['in']} {one['name']}"
            made.parameters[where] = self._member(
                one["schema"], one.get("required", False), f"{name} {where}"
            )
        body = stated.get("requestBody", {})
        made.body_required = body.get("required", False)
        made.body = self._content(body, f"{name} body")
        for status, answer in stated["responses"].items():
            if status == REFUSED or PROBLEM in answer.get("content", {}):
                continue
            made.answers[status] = self._content(answer, f"{name} {status}")

    def _content(self, stated: Node, place: str) -> dict[str, frozenset[str]]:
        content = stated.get("content", {})
        return {
            media: self._types(one.get("schema", {}), f"{place} {media}")
            for media, one in content.items()
        }

    def _member(self, schema: Node, required: bool, place: str) -> Member:
        stated = schema.get("default")
        default = None if stated is None else json.dumps(stated, ensure_ascii=False)
        return Member(types=self._types(schema, place), required=required, default=default)

    def _types(self, schema: Node, place: str) -> frozenset[str]:
        """The alternatives of a schema; schemas that they name are added."""
        if "$ref" in schema:
            name = schema["$ref"].rpartition("/")[2]
            return self._types({"title": name, **self._components[name], "named": name}, name)
        parts = [each for key in ("anyOf", "oneOf", "allOf") for each in schema.get(key, [])]
        if parts:
            return frozenset[str]().union(
                *(self._types(each, f"{place} {i}") for i, each in enumerate(parts))
            )
        if "const" in schema or "enum" in schema:
            values = schema.get("enum", [schema.get("const")])
            return frozenset(json.dumps(each, ensure_ascii=False) for each in values)
        kinds = schema.get("type", "object" if "properties" in schema else ANY)
        kinds = kinds if isinstance(kinds, list) else [kinds]
        return frozenset(self._type(kind, schema, place) for kind in kinds)

    def _type(self, kind: str, schema: Node, place: str) -> str:
        if kind == "array":
            return f"[{'|'.join(sorted(self._types(schema.get('items', {}), f'{place} items')))}]"
        if kind == "object" and "properties" in schema:
            return self._schema(schema, place)
        if kind == "object":
            more = schema.get("additionalProperties", {})
            return f"{{{'|'.join(sorted(self._types(more if isinstance(more, dict) else {}, f'{place} values')))}}}"
        return FORMATS.get(schema.get("format", ""), kind)

    def _schema(self, schema: Node, place: str) -> str:
        name = schema.get("named", place).replace(" ", "·")
        if name not in self.schemas:
            made = self.schemas[name] = {}  # before its members, which may name it
            needed = schema.get("required", [])
            for member, stated in schema["properties"].items():
                made[member] = self._member(stated, member in needed, f"{name} {member}")
        return str(name)


def breaks(old: Contract, new: Contract) -> Iterator[str]:
    """Sentences on what a client of the old contract can no longer rely on."""
    for name, before in old.operations.items():
        if (now := new.operations.get(name)) is None:
            yield f"{name} is gone"
            continue
        compared = _Comparison(old, new)
        yield from compared.members(before.parameters, now.parameters, name, "parameter", sent=True)
        if before.body and not now.body:
            yield f"{name} takes no body any more"
        if now.body_required and not before.body_required:
            yield f"{name} needs a body now"
        yield from compared.contents(before.body, now.body, f"{name}: body", sent=True)
        for status, contents in before.answers.items():
            if status not in now.answers:
                yield f"{name}: status {status} is gone"
            else:
                yield from compared.contents(
                    contents, now.answers[status], f"{name}: answer {status}", sent=False
                )


def additions(old: Contract, new: Contract) -> set[str]:
    """What the new contract states and the old does not."""
    known, found = (
        {f"{head} {word}" for head, words in blocks(each) for word in words} for each in (old, new)
    )
    return found - known


class _Comparison:
    """Of what is sent and of what is answered in one operation: each pair of schemas once."""

    def __init__(self, old: Contract, new: Contract) -> None:
        self.old, self.new = old, new
        self._seen: set[tuple[str, str, bool]] = set()

    def contents(
        self,
        old: dict[str, frozenset[str]],
        new: dict[str, frozenset[str]],
        place: str,
        *,
        sent: bool,
    ) -> Iterator[str]:
        for media, types in old.items():
            if media not in new:
                yield f"{place} as {media} is gone"
            else:
                yield from self.types(types, new[media], place, sent=sent)

    def members(
        self, old: dict[str, Member], new: dict[str, Member], place: str, noun: str, *, sent: bool
    ) -> Iterator[str]:
        for name, before in old.items():
            where = f"{place}: {noun} `{name}`"
            if (now := new.get(name)) is None:
                yield f"{where} is gone"
                continue
            if sent and now.required and not before.required:
                yield f"{where} is required now"
            if not sent and before.required and not now.required:
                yield f"{where} may be absent now"
            if sent and before.default != now.default and not (now.required or before.required):
                yield f"{where} was {before.default} where nothing was sent, is {now.default}"
            yield from self.types(before.types, now.types, where, sent=sent)
        for name in new.keys() - old.keys():
            if sent and new[name].required:
                yield f"{place}: new {noun} `{name}` is required"

    def types(
        self, old: frozenset[str], new: frozenset[str], place: str, *, sent: bool
    ) -> Iterator[str]:
        """What was accepted still is; what is answered was known, but for new constants."""
        narrow, wide = (old, new) if sent else (new, old)
        here, there = (self.old, self.new) if sent else (self.new, self.old)
        known = ANY in wide or ("string" in wide and all(each[0] == '"' for each in narrow))
        for kind in sorted(narrow - wide):
            fits = [
                each for each in sorted(wide) if _kind(each, there) == _kind(kind, here) != "plain"
            ]
            if (
                known
                or (kind == "integer" and "number" in wide)
                or (not sent and kind[0] == wide_constant(wide))
            ):
                continue
            if not fits:
                verb = "no longer accepts" if sent else "now answers"
                yield (
                    f"{place} {verb} {kind}; it was {'|'.join(sorted(old))}, is"
                    f" {'|'.join(sorted(new))}"
                )
                continue
            results = [
                list(self._inside(*((kind, f) if sent else (f, kind)), place, sent=sent))
                for f in fits
            ]
            yield from min(results, key=len)
        for kind in sorted(narrow & wide):
            yield from self._inside(kind, kind, place, sent=sent)

    def _inside(self, old: str, new: str, place: str, *, sent: bool) -> Iterator[str]:
        """What differs in two lists, objects or schemas."""
        if old in self.old.schemas and new in self.new.schemas:
            if (old, new, sent) not in self._seen:
                self._seen.add((old, new, sent))
                yield from self.members(
                    self.old.schemas[old], self.new.schemas[new], place, "member", sent=sent
                )
        elif old[0] in "[{":
            yield from self.types(
                _alternatives(old[1:-1]),
                _alternatives(new[1:-1]),
                f"{place}{old[0]}{old[-1]}",
                sent=sent,
            )


def wide_constant(wide: frozenset[str]) -> str:
    """The first letter of a string's constants, where there are any."""
    return '"' if any(each[0] == '"' for each in wide) else ""


def _kind(kind: str, contract: Contract) -> str:
    return "schema" if kind in contract.schemas else kind[0] if kind[0] in "[{" else "plain"


def _alternatives(text: str) -> frozenset[str]:
    """Types between bars, but for the bars within lists, objects and constants."""
    return frozenset(_split(text, "|"))


def _split(text: str, mark: str) -> list[str]:
    parts, depth, quoted, escaped = [""], 0, False, False
    for letter in text:
        if letter == '"' and not escaped:
            quoted = not quoted
        escaped = letter == "\\" and not escaped
        depth += 0 if quoted else (letter in "[{") - (letter in "]}")
        if letter == mark and not depth and not quoted:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def check(found: Contract) -> None:
    """The contract is as it is kept; or, where `WRITE` is set, it is kept as it is."""
    kept = read(FILE.read_text(encoding="utf-8")) if FILE.exists() else Contract({"paths": {}})
    if text(found) == text(kept):
        return
    broken, added = sorted(breaks(kept, found)), sorted(additions(kept, found))
    said = "\n  ".join(["Breaks what relies on it:", *(broken or ["nothing"])])
    said += "\n  ".join(["\nIs new or another:", *added])
    if os.environ.get(WRITE):
        FILE.write_text(text(found), encoding="utf-8")
        sys.stdout.write(f"\n{FILE.name}: {said}\n")
        return
    raise AssertionError(
        f"{FILE.name} is not what the service promises; if that is meant: {COMMAND}\n{said}"
    )


# --- as text -----------------------------------------------------------------------------------------------------------


def blocks(contract: Contract) -> Iterator[tuple[str, list[str]]]:
    """Operations, then schemas, sorted: the head of each, and a word for each thing that it
    states.
    """
    for name, one in sorted(contract.operations.items(), key=lambda item: item[0].split()[::-1]):
        stated = sorted(
            (where, each)
            for where, each in one.parameters.items()
            if (where, each) not in _ids(name).items()
        )
        words = [
            _word(where.removeprefix("query ").replace(" ", "."), each) for where, each in stated
        ]
        sign = "<" if one.body_required else "<?"
        words += [
            f"{sign}{_short(media)}:{_types(kinds)}" for media, kinds in sorted(one.body.items())
        ]
        for status, contents in sorted(one.answers.items()):
            words += [
                f"{status} {_short(media)}:{_types(kinds)}"
                for media, kinds in sorted(contents.items())
            ] or [status]
        yield name, words
    for name, members in sorted(contract.schemas.items()):
        yield f"= {name}", [_word(member, each) for member, each in members.items()]


def _ids(operation: str) -> dict[str, Member]:
    """The ids in a path, which need no words."""
    return {
        f"path {name}": Member(types=frozenset({"id"}), required=True)
        for name in ID.findall(operation)
    }


def text(contract: Contract) -> str:
    """A contract as text."""
    return "".join(
        f"{head}\n" + "".join(f" {word}\n" for word in words) for head, words in blocks(contract)
    )


def _short(media: str) -> str:
    return "" if media == JSON else media


def _word(name: str, member: Member) -> str:
    default = "" if member.default is None else f"={member.default}"
    return f"{name}{'' if member.required else '?'}:{_types(member.types)}{default}"


def _types(kinds: frozenset[str]) -> str:
    return "|".join(sorted(kinds))


def read(lines: str) -> Contract:
    """The contract of such a text."""
    made, one, schema = Contract({"paths": {}}), Operation(), dict[str, Member]()
    for line in lines.splitlines():
        word = line.strip()
        if line.startswith("= "):
            schema = made.schemas[line[2:]] = {}
        elif not line.startswith(" "):
            one = made.operations[line] = Operation()
            schema = one.parameters
            schema.update(_ids(line))
        elif word[0] == "<":
            media, _, kinds = word[1:].removeprefix("?").partition(":")
            one.body[media or JSON] = _alternatives(kinds)
            one.body_required |= word[1] != "?"
        elif word[:3].isdigit():
            media, _, kinds = word[4:].partition(":")
            one.answers.setdefault(word[:3], {}).update(
                {media or JSON: _alternatives(kinds)} if kinds else {}
            )
        else:
            name, member = _member_of(word)
            where = (
                name.replace(".", " ", 1)
                if name.startswith(("header.", "path.", "cookie."))
                else f"query {name}"
            )
            schema[where if schema is one.parameters else name] = member
    return made


def _member_of(word: str) -> tuple[str, Member]:
    name, _, rest = word.partition(":")
    kinds, *default = _split(rest, "=")
    required = not name.endswith("?")
    value = "=".join(default) if default else None
    return name.removesuffix("?"), Member(
        types=_alternatives(kinds), required=required, default=value
    )
