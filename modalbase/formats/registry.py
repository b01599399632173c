"""The formats of measured data, the one place where a format's facts stand: what recognises a file
of it, its suffixes and media types, what it may hold, what is stated beside it, what reads and
writes it, and what it needs. Everything else iterates over the table: recognition, the reading of
an import, pages, commands, routes, the guide.

A member that a format does not take is refused by name: what is stated is used or refused. This
module loads no numpy: readers and writers are named, `frfs.csv:read_csv` below `modalbase.formats`,
and loaded where they are used.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import Any, Literal, get_args

from modalbase.formats.errors import FormatError

Kind = Literal["hits", "frfs", "responses", "loads"]
Member = Literal["kind", "quantity", "mapping"]
"""What may be stated beside a file: what it holds, what its FRFs are, which of its variables is
what.
"""

MEMBERS: tuple[Member, ...] = get_args(Member)

_BY_CHANNEL = "each channel states its own, in mapping.channels"
_IN_BODY = "it is a member of the body itself"


def load(where: str) -> Any:
    """The function that a row of the table names as `module:name` below `modalbase.formats`."""
    module, name = where.split(":")
    return getattr(import_module(f"modalbase.formats.{module}"), name)


@dataclass(frozen=True)
class Dependency:
    """A package that a format needs and that not everybody installs."""

    module: str  # that is imported
    package: str  # that has it
    extra: str  # of modalbase, which brings it
    file: str = ""  # which files need it; empty: all of the format
    otherwise: str = ""  # what helps without it


@dataclass(frozen=True)
class Writer:
    """A way to write FRFs."""

    name: str  # in `?format=`
    media_type: str  # of the file
    value_bytes: int  # about what a value takes, its coherence included
    where: str  # function of a table and a file; of a sequence of tables where not `one_table`
    one_table: bool = True  # only FRFs of one quantity on one axis can be written
    exact: bool = True  # every bit is kept
    suffix: str = ""  # of its name, without a dot: the first one of its format

    def write(self, tables: Any, file: Any) -> None:
        """Write what the function takes to a file that is open for bytes."""
        load(self.where)(tables, file)


@dataclass(frozen=True)
class Format:
    """A format of measured data. One with `frfs` reads FRFs that need no mapping."""

    name: str  # in REST and in what is stored
    title: str  # in sentences
    takes: Mapping[
        Kind, tuple[Member, ...]
    ]  # what may be stated, by what a file holds; a kind that it lacks it cannot hold
    # in words, of what is not taken: what is meant
    instead: Mapping[Member, str] = field(default_factory=dict)
    about: str = ""  # a sentence for the guide
    suffixes: tuple[str, ...] = ()  # its own
    other_suffixes: tuple[str, ...] = ()  # under which files of other formats come, too
    media_types: tuple[str, ...] = ()  # of a body that holds it
    marks: tuple[bytes, ...] = ()  # first bytes, of which it has one
    opening: re.Pattern[bytes] | None = None  # how its text begins
    inside: re.Pattern[bytes] | None = None  # the same where other words may stand before
    needs: tuple[Dependency, ...] = ()  # what not everybody installs
    # functions, as `load` takes them
    arrays: str = ""  # path, most bytes -> arrays by name
    recording: str = ""  # path[, layout of its table] -> recording that is read part by part
    parts: str = ""  # path -> the same, of a format whose files mostly hold other arrays
    frfs: str = ""  # path, most bytes, quantity -> `Frfs` of a file that needs no mapping
    # path -> names of what such a file states; None of one that it is not
    own_names: str = ""
    texts: str = ""  # path, most bytes -> what it says in words, by name
    is_table: bool = False  # of text, whose layout a mapping may state
    states_quantity: bool = False  # its own FRFs may say what they are
    fixed_rate: bool = False  # its head states one sampling rate for all channels
    writers: tuple[Writer, ...] = ()

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """What a file of the format may hold."""
        return tuple(self.takes)

    @property
    def looked_at(self) -> bool:
        """Whether a file is looked at before it is read, as it may need a mapping, whatever it
        holds.
        """
        return all("mapping" in members for members in self.takes.values())

    @property
    def either(self) -> bool:
        """Whether arrays of a file are hits or FRFs, as is stated beside it."""
        return self.looked_at and {"hits", "frfs"} <= self.takes.keys()

    @property
    def every_suffix(self) -> tuple[str, ...]:
        """Its own suffixes, and the others under which its files come."""
        return self.suffixes + self.other_suffixes

    def names_in(self, path: Any) -> frozenset[str] | None:
        """Names of what a file of FRFs that need no mapping states; None of another file."""
        names: frozenset[str] | None = load(self.own_names)(path) if self.own_names else None
        return names

    def dependency(self, module: str) -> Any:
        """A module that the format needs.

        Raises:
            FormatError: it is not installed; says what to install.
        """
        need = next(need for need in self.needs if module.split(".")[0] == need.module)
        try:
            import_module(need.module)
            return import_module(module)
        except ImportError:
            raise FormatError(
                "",
                f"is a {need.file or f'{self.title} file'}, which {need.package} reads: pip"
                f" install 'modalbase[{need.extra}]'{need.otherwise}",
            ) from None

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
    "responses": ("kind", "mapping"),
    "loads": ("kind", "mapping"),
}
_HITS: Mapping[Kind, tuple[Member, ...]] = {
    "hits": ("kind", "mapping"),
    "responses": ("kind", "mapping"),
    "loads": ("kind", "mapping"),
}
_CHANNELS: Mapping[Member, str] = {"quantity": _BY_CHANNEL}

HDF5 = "application/x-hdf5"
"""Media type of an HDF5 file."""

_ROWS = (
    Format(
        "uff",
        "UFF",
        {
            "frfs": ("quantity",),
            "hits": ("mapping",),
            "responses": ("kind", "mapping"),
            "loads": ("kind", "mapping"),
        },
        {
            "kind": "a UFF says of each dataset what it is, but for recordings that go on",
            "mapping": "only a recording has one",
        },
        about="Universal File Format, sets 58 and 58b: [UFF files](uff.md)",
        suffixes=(".uff", ".unv", ".uf", ".bunv", ".ufb"),
        opening=re.compile(rb"\A(?:\xef\xbb\xbf)?\s*-1[ \t]*\r?(?:\n|\Z)"),
        inside=re.compile(rb"^[ \t]*-1[ \t]*\r?\n[ \t]*\d{1,6}[ \t\r\nb]", re.MULTILINE),
        recording="records.uff:open_uff",
        writers=(
            Writer("uff", "application/x-uff", 24, "frfs.uff:write_uff", one_table=False),
            Writer(
                "uff-ascii", "text/x-uff", 62, "frfs.uff:write_text", one_table=False, exact=False
            ),
        ),
    ),
    Format(
        "npz",
        "npz",
        _ARRAYS,
        _CHANNELS,
        about="arrays of numpy",
        suffixes=(".npz",),
        media_types=("application/x-npz",),
        marks=(b"PK",),
        arrays="records.variables:npz_arrays",
        texts="statements:array_texts",
        parts="records.npz:open_npz",
        frfs="frfs.npz:read_npz",
        own_names="frfs.npz:own_names",
        states_quantity=True,
        writers=(Writer("npz", "application/x-npz", 24, "frfs.npz:write_npz"),),
    ),
    Format(
        "npy",
        "npy",
        _ARRAYS,
        _CHANNELS,
        about="one array of numpy, whose columns are channels",
        suffixes=(".npy",),
        media_types=("application/x-npy",),
        marks=(b"\x93NUMPY",),
        arrays="records.variables:npy_arrays",
        parts="records.npz:open_npy",
    ),
    Format(
        "mat",
        ".mat",
        _ARRAYS,
        _CHANNELS,
        about="variables of MATLAB, version 4 to 7.3",
        suffixes=(".mat",),
        media_types=("application/x-matlab-data",),
        marks=(b"MATLAB ",),
        needs=(
            Dependency("scipy", "scipy", "server"),
            Dependency("h5py", "h5py", "mat73", ".mat of version 7.3", "; or save it with -v7"),
        ),
        arrays="records.variables:mat_arrays",
        texts="statements:array_texts",
    ),
    Format(
        "hdf5",
        "HDF5",
        _ARRAYS,
        _CHANNELS,
        about="datasets by their path, `daq.acc`, and attributes, `daq.acc@rate`",
        suffixes=(".h5", ".hdf5", ".hdf"),
        media_types=(HDF5,),
        marks=(b"\x89HDF\r\n\x1a\n",),
        needs=(Dependency("h5py", "h5py", "server"),),
        arrays="records.hdf5:hdf5_arrays",
        texts="records.hdf5:hdf5_texts",
        parts="records.hdf5:open_hdf5",
        frfs="frfs.hdf5:read_hdf5",
        own_names="frfs.hdf5:own_names",
        states_quantity=True,
        writers=(Writer("hdf5", HDF5, 24, "frfs.hdf5:write_hdf5"),),
    ),
    Format(
        "csv",
        "CSV",
        _ARRAYS,
        _CHANNELS,
        about="[tables of text](hammer.md#tables-of-text), with any separator",
        suffixes=(".csv",),
        other_suffixes=(".tsv", ".txt", ".dat", ".asc", ".lvm", ".prn", ".tab", ".tra", ".text"),
        media_types=("text/csv",),
        arrays="records.variables:csv_arrays",
        texts="statements:table_texts",
        recording="records.text:open_recording",
        frfs="frfs.csv:read_csv",
        own_names="frfs.csv:own_names",
        is_table=True,
        writers=(Writer("csv", "text/csv", 90, "frfs.csv:write_csv"),),
    ),
    Format(
        "wav",
        "wav",
        _HITS,
        _CHANNELS,
        about="samples of a recorder, from −1 to 1",
        suffixes=(".wav",),
        media_types=("audio/wav", "audio/x-wav"),
        marks=(b"RIFF", b"RIFX", b"RF64"),
        arrays="records.variables:wav_arrays",
        recording="records.wav:read_wav_head",
        texts="records.wav:wav_texts",
        fixed_rate=True,
    ),
    Format(
        "tdms",
        "TDMS",
        _HITS,
        _CHANNELS,
        about="NI's format of LabVIEW and FlexLogger",
        suffixes=(".tdms",),
        marks=(b"TDSm",),
        needs=(Dependency("nptdms", "npTDMS", "tdms"),),
        recording="records.tdms:read_tdms_head",
        texts="records.tdms:tdms_texts",
    ),
    Format(
        "mdf",
        "MDF",
        _HITS,
        _CHANNELS,
        about="ASAM's format of data acquisition, version 3 and 4",
        suffixes=(".mf4", ".mdf", ".mf3"),
        marks=(b"MDF     ", b"UnFinMF "),
        needs=(Dependency("asammdf", "asammdf", "mdf"),),
        texts="records.mdf:mdf_texts",
        recording="records.mdf:read_mdf_head",
    ),
)
FORMATS: Mapping[str, Format] = {row.name: row for row in _ROWS}
"""Files, by the name of their format."""

JSON = Format(
    "JSON body",
    "JSON",
    {"frfs": (), "hits": ()},
    {"quantity": _IN_BODY, "mapping": _IN_BODY, "kind": "its address says it"},
    about="what a script sends and gets in place of a file",
    suffixes=(".json",),
    media_types=("application/json",),
    writers=(Writer("json", "application/json", 70, "frfs.json:write_json"),),
)
ARROW = Format(
    "arrow",
    "Arrow",
    {},
    about="an IPC stream with the columns of the CSV, a record batch an FRF",
    suffixes=(".arrows", ".arrow"),
    needs=(Dependency("nanoarrow", "nanoarrow", "server"),),
    writers=(Writer("arrow", "application/vnd.apache.arrow.stream", 50, "frfs.arrow:write_arrow"),),
)
PARQUET = Format(
    "parquet",
    "Parquet",
    {},
    about="a table with the columns of the CSV",
    suffixes=(".parquet",),
    needs=(Dependency("arro3", "arro3-io", "server"),),
    writers=(
        Writer("parquet", "application/vnd.apache.parquet", 50, "frfs.parquet:write_parquet"),
    ),
)
ALL = (JSON, *FORMATS.values(), ARROW, PARQUET)
"""Those of files, of bodies, and those that are only written."""

WRITERS: Mapping[str, Writer] = {
    writer.name: replace(writer, suffix=row.suffixes[0].removeprefix("."))
    for one_table in (True, False)  # text/* in Accept is a CSV, not a UFF
    for row in ALL
    for writer in row.writers
    if writer.one_table is one_table
}
"""Ways to write FRFs by their name, the default first."""

FRF_SUFFIXES: dict[str, str] = {
    suffix: row.writers[0].name for row in ALL if row.writers for suffix in row.suffixes
}
"""The name of a way to write FRFs, by the end of a file's name."""


def titles(rows: Iterable[Format] = FORMATS.values(), last: str = "or") -> str:
    """Formats in a sentence: "UFF, npz or CSV"; with commas alone where `last` is empty."""
    *some, end = (row.title for row in rows)
    return f"{', '.join(some)} {last} {end}" if some and last else ", ".join([*some, end])


def looked_at() -> list[Format]:
    """Those whose files are looked at before they are read."""
    return [row for row in FORMATS.values() if row.looked_at]


def either() -> list[Format]:
    """Those whose arrays are hits or FRFs, as is stated."""
    return [row for row in FORMATS.values() if row.either]


def of_bodies(kind: Kind) -> dict[str, str]:
    """The format of a body that holds hits or FRFs, by its media type."""
    return {
        media_type: row.name
        for row in FORMATS.values()
        if kind in row.takes
        for media_type in row.media_types
    }
