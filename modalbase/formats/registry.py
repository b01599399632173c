"""The formats of measured data: one table of what a file of each may hold, and of what is stated
beside it.

A member that a format does not take is refused by name: what is stated is used or refused.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

from modalbase.formats.errors import FormatError

FormatName = Literal["uff", "npz", "mat", "csv", "wav", "tdms"]
Kind = Literal["hits", "frfs"]
Member = Literal["kind", "quantity", "mapping"]
"""What may be stated beside a file: what it holds, what its FRFs are, which of its variables is
what.
"""

MEMBERS: tuple[Member, ...] = get_args(Member)

_BY_CHANNEL = "each channel states its own, in mapping.channels"
_IN_BODY = "it is a member of the body itself"


@dataclass(frozen=True)
class Format:
    """A format of measured data."""

    name: str
    takes: Mapping[
        Kind, tuple[Member, ...]
    ]  # what may be stated, by what a file holds; a kind that it lacks it cannot hold
    # in words, of what is not taken: what is meant
    instead: Mapping[Member, str] = field(default_factory=dict)

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """What a file of the format may hold."""
        return tuple(self.takes)

    def require_taken(self, kind: Kind | None, stated: Iterable[Member]) -> None:
        """Refuse what is stated and not taken with a file.

        Args:
            kind: what the file holds; None where that is not known, or where it may hold both.
            stated: names of what was stated.

        Raises:
            FormatError: the format cannot hold such a thing, or each member that is not taken, with
                what is.
        """
        if kind is not None and kind not in self.takes:
            raise FormatError(
                "kind", f"is {kind}, and a {self.name} holds {' or '.join(self.kinds)}"
            )
        kinds = self.kinds if kind is None else (kind,)
        taken = [member for member in MEMBERS if any(member in self.takes[one] for one in kinds)]
        what = self.name if kind is None else f"{self.name} of {'FRFs' if kind == 'frfs' else kind}"
        takes = f"it takes {' and '.join(taken)}" if taken else "nothing is stated beside it"
        faults = [
            (str(member), f"is not taken with {what}: {self.instead.get(member, takes)}")
            for member in MEMBERS
            if member in stated and member not in taken
        ]
        if faults:
            raise FormatError(faults)


_ARRAYS: Mapping[Kind, tuple[Member, ...]] = {
    "frfs": ("kind", "quantity", "mapping"),
    "hits": ("kind", "mapping"),
}
_HITS: Mapping[Kind, tuple[Member, ...]] = {"hits": ("kind", "mapping")}
_CHANNELS: Mapping[Member, str] = {"quantity": _BY_CHANNEL}

FORMATS: Mapping[FormatName, Format] = {
    "uff": Format(
        "uff",
        {"frfs": ("quantity",), "hits": ("mapping",)},
        {
            "kind": "a UFF says of each dataset what it is",
            "mapping": "only a recording of hits has one",
        },
    ),
    "npz": Format("npz", _ARRAYS, _CHANNELS),
    "mat": Format("mat", _ARRAYS, _CHANNELS),
    "csv": Format("csv", _ARRAYS, _CHANNELS),
    "wav": Format("wav", _HITS, _CHANNELS),
    "tdms": Format("tdms", _HITS, _CHANNELS),
}
"""Files, by the name of their format."""

JSON = Format(
    "JSON body",
    {"frfs": (), "hits": ()},
    {"quantity": _IN_BODY, "mapping": _IN_BODY, "kind": "its address says it"},
)
"""What a script sends in place of a file."""
