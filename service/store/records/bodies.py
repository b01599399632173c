"""Time blocks that a script sends as JSON, with arrays and a mapping."""

from __future__ import annotations

from typing import Any

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records import Mapping, TimeBlock, Variables, blocks_of, propose, read_mapping
from service.errors import Fault, Invalid, pointer
from service.store.records.schemas import Proposal
from service.web.json_body import parse_json


class Sent:
    """What a client sent: named arrays, and a mapping where there is one."""

    def __init__(self, variables: Variables, document: Any) -> None:
        self.variables = variables
        self.document = document

    def blocks(self) -> tuple[list[TimeBlock], Mapping]:
        """The time blocks, and the mapping that made them.

        Raises:
            Invalid: there is no mapping, or it does not fit the arrays; each fault with its pointer.
        """
        if self.document is None:
            raise Invalid("mapping", "is missing; ?dry_run=true proposes one")
        try:
            mapping = read_mapping(self.document)
            return blocks_of(self.variables, mapping), mapping
        except FormatError as error:
            raise _invalid(error) from None

    def proposal(self) -> Proposal:
        """What the arrays are, a mapping that suggests itself, and what the stated one makes of them.

        Raises:
            Invalid: there is a mapping and it does not fit the arrays.
        """
        shapes = {name: f"{array.dtype} {list(array.shape)}" for name, array in sorted(self.variables.items())}
        blocks = None if self.document is None else len(self.blocks()[0])
        return Proposal(variables=shapes, mapping=propose(self.variables), blocks=blocks)


def from_json(body: bytes) -> Sent:
    """Arrays of a JSON body `{"variables": {"force": [...], ...}, "mapping": {...}}`.

    Raises:
        Invalid: an array does not hold numbers alone; each fault with its pointer.
    """
    sent = parse_json(body)
    if (
        not isinstance(sent, dict)
        or not isinstance(sent.get("variables"), dict)
        or sent.keys() - {"variables", "mapping"}
    ):
        raise Invalid("", 'is not {"variables": {name: numbers}, "mapping": {...}}')
    variables: Variables = {}
    for name, values in sent["variables"].items():
        try:
            variables[name] = np.array(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise Invalid(pointer(["variables", name]), "is not a number or a regular array of numbers") from None
    return Sent(variables, sent.get("mapping"))


def _invalid(error: FormatError) -> Invalid:
    return Invalid([Fault(pointer(place.split(".") if place else []), why) for place, why in error.faults])
