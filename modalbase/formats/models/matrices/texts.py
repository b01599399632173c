"""Text files of matrices and their tables."""

from __future__ import annotations

import warnings
from codecs import BOM_UTF8

import numpy as np

from modalbase.formats.columns import read_columns, real, whole
from modalbase.formats.errors import FormatError
from modalbase.formats.models.matrices.model import DOFS, Entries, code, integers
from modalbase.formats.models.model import Floats, Integers

_MARK = "%%MatrixMarket"


def read_text(name: str, content: bytes) -> Entries:
    """Matrix Market; rows, columns and values as CalculiX stores them; node, dof, node, dof, value as Abaqus does.

    Raises:
        FormatError: it is none of these, or holds more or fewer entries than it says.
    """
    text = content.removeprefix(BOM_UTF8).decode("latin-1")
    if text[: len(_MARK)].lower() == _MARK.lower():
        return _market(name, text)
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith(("*", "#", "%"))]
    table = _numbers(name, " ".join(lines).replace(",", " "))
    width = len(lines[0].replace(",", " ").split()) if lines else 0
    if width not in (3, 5) or table.size % width:
        raise FormatError(name, "is no table of row, column, value nor of node, dof, node, dof, value")
    table = table.reshape(-1, width)
    places = integers(name, table[:, :-1])
    if width == 3:
        return Entries(places[:, 0] - 1, places[:, 1] - 1, table[:, 2])
    if np.any((places[:, 1::2] < 1) | (places[:, 1::2] > DOFS)):
        raise FormatError(name, "has a dof that is not 1 … 6")
    rows, columns = code(places[:, 0], places[:, 1] - 1), code(places[:, 2], places[:, 3] - 1)
    return Entries(rows, columns, table[:, 4], is_labelled=True)


def _market(name: str, text: str) -> Entries:
    """NIST's exchange format (Boisvert, Pozo, Remington, 1996)."""
    head, *lines = text.splitlines()
    words = head.lower().split()
    if len(words) != 5 or words[1] != "matrix" or words[2] not in ("coordinate", "array"):
        raise FormatError(
            f"{name} line 1", f"is {head[:60]!r}, expected %%MatrixMarket matrix coordinate real symmetric"
        )
    if words[3] not in ("real", "integer", "double") or words[4] not in ("general", "symmetric"):
        raise FormatError(f"{name} line 1", f"says {words[3]} {words[4]}, expected real, and general or symmetric")
    table = _numbers(name, " ".join(line for line in lines if not line.lstrip().startswith("%")))
    is_sparse, is_half = words[2] == "coordinate", words[4] == "symmetric"
    head_size = 3 if is_sparse else 2
    if table.size < head_size:
        raise FormatError(name, "ends before its size")
    sizes = integers(name, table[:head_size])
    count, table = int(sizes[0]), table[head_size:]
    if sizes[0] != sizes[1] or count < 1:
        raise FormatError(name, f"has {sizes[0]} rows and {sizes[1]} columns, expected as many")
    stated = 3 * int(sizes[2]) if is_sparse else count * (count + 1) // 2 if is_half else count**2
    if table.size != stated:
        raise FormatError(name, f"holds {table.size} numbers, and says that it has {stated}; it seems to be cut")
    if is_sparse:
        table = table.reshape(-1, 3)
        places = integers(name, table[:, :2]) - 1
        return Entries(places[:, 0], places[:, 1], table[:, 2], is_half=is_half, size=count)
    columns, rows = np.triu_indices(count) if is_half else np.indices((count, count)).reshape(2, -1)
    return Entries(rows, columns, table, is_half=is_half, size=count)


def read_nodes(name: str, content: bytes) -> tuple[Integers, Floats]:
    """Numbers and coordinates of a table with the columns `node`, `x`, `y`, `z`."""
    rows = _table(name, content, ("node", "x", "y", "z"))
    numbers = integers(name, np.array([whole(cells[0], f"{name} {place}, node") for place, cells in rows], dtype=float))
    places = [[real(cell, f"{name} {place}, {axis}") for axis, cell in zip("xyz", cells[1:], strict=True)]
              for place, cells in rows]  # fmt: skip
    return numbers, np.array(places, dtype=float).reshape(-1, 3)


def read_dofs(name: str, content: bytes) -> Integers:
    """(d,) codes of the dofs of a table with the columns `node`, `dof`, or of lines `node.dof` as CalculiX stores them."""
    text = content.decode("latin-1")
    if name.lower().endswith(".dof"):
        pairs = [
            (f"line {at}", line.strip().split(".")) for at, line in enumerate(text.splitlines(), 1) if line.strip()
        ]
    else:
        pairs = _table(name, content, ("node", "dof"))
    found = []
    for place, cells in pairs:
        if len(cells) != 2:
            raise FormatError(f"{name} {place}", f"is {'.'.join(cells)[:40]!r}, expected a node and a dof such as 17.3")
        dof = whole(cells[1], f"{name} {place}, dof")
        if not 1 <= dof <= DOFS:
            raise FormatError(f"{name} {place}", f"has the dof {dof}, expected 1 … 6")
        found.append((whole(cells[0], f"{name} {place}, node"), dof - 1))
    nodes, dofs = integers(name, np.array(found, dtype=float)).reshape(-1, 2).T
    return code(nodes, dofs)


def _table(name: str, content: bytes, columns: tuple[str, ...]) -> list[tuple[str, list[str]]]:
    """Lines and cells of the columns, in this order."""
    try:
        header, rows = read_columns(content.decode("utf-8-sig").splitlines(keepends=True))
        places = [header.index(column) for column in columns]
        return [(f"line {line}", [cells[at] for at in places]) for line, cells in rows]
    except UnicodeDecodeError as error:
        raise FormatError(name, "is not text in UTF-8") from error
    except ValueError as error:
        raise FormatError(name, f"lacks a column of {', '.join(columns)}") from error
    except FormatError as error:
        raise FormatError(f"{name} {error.place}".rstrip(), error.message) from error


def _numbers(name: str, text: str) -> Floats:
    text = text.replace("D", "E").replace("d", "e")
    if not text.strip():
        return np.zeros(0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # so numpy calls text that it cannot read to its end
            return np.fromstring(text, sep=" ")
    except (ValueError, DeprecationWarning):
        strange = next((word for word in text.split() if not _is_number(word)), "")
        raise FormatError(name, f"holds what is not a number: {strange[:40]!r}") from None


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
