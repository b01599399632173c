"""Formats of other programs that nothing here reads: what shows them, and what to export instead.

A file is known by how it begins, and where it is no text by the end of its name.
"""

import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import NamedTuple

from modalbase.formats.errors import FormatError

UTF_16 = BOM_UTF16_LE, BOM_UTF16_BE
NO_UTF_16 = "the file is text in UTF-16; save it as ANSI or UTF-8"
HEAD_BYTES = 1 << 16
"""First bytes of a file by which its format is known."""


class ForeignFormat(NamedTuple):
    """A row of the tables."""

    title: str  # in sentences
    instead: str  # what to export or send
    suffixes: str = ""  # ends of names, with blanks between them
    opening: re.Pattern[bytes] | None = None  # how its files begin


_UFF = "UFF (set 58)"
_TIME = "MDF, TDMS, .mat or text"
MEASURED = (
    ForeignFormat("an imc FAMOS file", f"save it as {_TIME}", opening=re.compile(rb"\|CF,\d")),
    ForeignFormat("a Polytec scan", f"export {_UFF} by the PSV software", ".svd .pvd"),
    ForeignFormat("a Test.Lab project", f"export {_UFF} or .mat", ".lms .ldsf .ldsp"),
    ForeignFormat("a PULSE or BK Connect file", f"export {_UFF}", ".plb .pls .pti .bkc"),
    ForeignFormat("an ME'scope project", f"export {_UFF}", ".vtprj .blk .shp"),
    ForeignFormat("a DEWESoft file", f"export {_UFF}, {_TIME}", ".dxd .d7d .dxz"),
    ForeignFormat("a catman file", f"export {_TIME}", ".bin .tst"),
    ForeignFormat("an OROS or Crystal Instruments file", f"export {_UFF} or text", ".oros .orp .recs"),
    ForeignFormat("an nCode or HBM file", f"export {_TIME}", ".s3t .dac .sie .pmx"),
    ForeignFormat("an RPC III file", f"export {_TIME}", ".rsp .rpc .drv", re.compile(rb"FORMAT\0\0")),
    ForeignFormat("a testXpert or Bluehill file", "export its curve as text", ".zs2 .zp2 .is_tens .im_tens"),
    ForeignFormat("a DIAdem header without its data", "save it as TDMS", ".tdx",
                  re.compile(rb"<\?xml[^\0]{0,500}?<usi:tdm")),
    ForeignFormat("an ASAM ODS file", f"export {_UFF}, {_TIME}", opening=re.compile(rb"<\?xml[^\0]{0,500}?<atfx_file")),
    ForeignFormat("a page of HTML or XML", "save its table as CSV",
                  opening=re.compile(rb"\s*<(\?xml|!doctype|html|table)", re.IGNORECASE)),
    ForeignFormat("a PDF", "export the data themselves, as UFF or text", opening=re.compile(rb"%PDF-")),
    ForeignFormat("a database of SQLite", f"export {_UFF}, {_TIME}", opening=re.compile(rb"SQLite format 3")),
)  # fmt: skip
"""Of measured data."""

_DECK = "bulk data of Nastran or an .inp of Abaqus"
_MATRICES = "send K and M as Matrix Market (*EXPORT, MMF) with nodes.csv"
_BY_PREPROCESSOR = f"let a pre-processor write it as {_DECK}"
MODELS = (
    ForeignFormat("a deck of Ansys", f"{_BY_PREPROCESSOR}, or {_MATRICES}", ".cdb .mac .ans .anf",
                  re.compile(rb"\s*(![^\n]*\n\s*)*/(com|prep7|batch|title|nopr|units|filname)\b", re.IGNORECASE)),
    ForeignFormat("results of Ansys", _MATRICES, ".rst .full .db .mechdb .mechdat"),
    ForeignFormat("a deck of LS-DYNA", _BY_PREPROCESSOR, ".k .key .dyn",
                  re.compile(rb"\s*(\$[^\n]*\n\s*)*\*KEYWORD\b", re.IGNORECASE)),
    ForeignFormat("a deck of Radioss", _BY_PREPROCESSOR, ".rad", re.compile(rb"\s*#RADIOSS")),
    ForeignFormat("matrices of MATLAB or of Harwell and Boeing", "send K and M as Matrix Market (.mtx) or .npz, with nodes.csv",
                  ".mat .hb .rb .rsa .rua .psa"),
    ForeignFormat("results of Nastran", "send the deck itself (.bdf), or its matrices (.pch)", ".op2 .op4 .f06 .xdb .master"),
    ForeignFormat("a file of Abaqus", "write its .inp", ".odb .cae .fil .sim"),
    ForeignFormat("geometry without elements", f"mesh its middle surfaces with shells, and export {_DECK}",
                  ".stp .step .igs .iges .x_t .x_b .sldprt .sldasm .ipt .catpart .prt .stl", re.compile(rb"ISO-10303-21")),
    ForeignFormat("a mesh of Salome", "export it as UNV", ".med"),
    ForeignFormat("a file of COMSOL, HyperMesh, Patran, Femap or ANSA", f"export {_DECK}",
                  ".mph .mphtxt .mphbin .hm .neu .modfem .ansa .pat .out"),
)  # fmt: skip
"""Of models."""


def refuse_foreign(
    head: bytes, name: str, table: Sequence[ForeignFormat], of: str = "the file"
) -> None:
    """Refuse a file of a format that is not read.

    Args:
        head: its first bytes; none where its name alone is known.
        name: what its sender calls it.
        table: formats that it may have.
        of: what the message calls it.

    Raises:
        FormatError: it has one of these; says which and what to export.
    """
    suffix = PurePosixPath(name).suffix.lower()
    for row in table:
        is_own = bool(suffix) and suffix in row.suffixes.split()
        by_name = is_own and (not head or b"\0" in head)
        if by_name or (row.opening and row.opening.match(head)):
            raise FormatError("", f"{of} is {row.title}, which is not read; {row.instead}")


def require_text(content: bytes, of: str) -> None:
    """Refuse what is no text of one byte a character.

    Args:
        content: the file, or its first bytes.
        of: what was expected, for the message.

    Raises:
        FormatError: as said; UTF-16 by its name.
    """
    if content.startswith(UTF_16):
        raise FormatError("", NO_UTF_16)
    if b"\0" in content:
        raise FormatError("", f"the file holds NUL bytes; expected {of}")
