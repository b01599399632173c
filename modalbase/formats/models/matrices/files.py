"""Files of matrices and of the tables that say what their rows are.

npz has `nodes` (n, 4) with numbers first, `dofs` (d, 2), and `K_0` … dense, or by their sparse
parts. Text is Matrix Market, or what CalculiX and Abaqus write. DMIG is what Nastran punches, with
the grids where the punch has them.
"""

import io
import warnings
import zipfile
from codecs import BOM_UTF8
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf.card import Card, cards_of
from modalbase.formats.models.bdf.frames import read_grids
from modalbase.formats.models.bdf.lines import split_deck
from modalbase.formats.models.model import Floats, Integers
from modalbase.formats.npy import Array, members_of, read_array
from modalbase.formats.tables import read_rows, real, whole, whole_rows

DOFS = 6
"""Of a node."""

_MOST = 1e12
_PARTS = ("data", "indices", "indptr")


@dataclass(frozen=True)
class Entries:
    """Entries of a matrix."""

    # rows, columns: from 0, or codes of `code` where `is_labelled`
    rows: Integers
    columns: Integers
    values: Floats  # of them
    is_labelled: bool = False  # whether they are known by node and dof
    # whether one triangle stands for both; None where the entries themselves must show it
    is_half: bool | None = None
    size: int | None = None  # of a matrix whose rows are numbered


def code(nodes: Integers, dofs: Integers) -> Integers:
    """One number for a node's number and a dof from 0."""
    return nodes * DOFS + dofs


def integers(place: str, values: NDArray[Any]) -> Integers:
    """Numbers of rows, nodes and dofs.

    Raises:
        FormatError: one is not whole, or has more than 12 digits.
    """
    exact = np.asarray(values, dtype=float)
    if not np.all((np.abs(exact) < _MOST) & (exact == np.round(exact))):
        raise FormatError(
            place, "has a row, column, node or dof that is not a whole number of at most 12 digits"
        )
    return exact.astype(np.int64)


def read_archive(
    name: str, content: bytes, limit_bytes: int
) -> tuple[dict[str, Entries], tuple[Integers, Floats] | None, Integers | None]:
    """Matrices, nodes and dofs of an archive; of a sparse `K_0` the arrays `K_0_data`,
    `K_0_indices`, `K_0_indptr`.

    Raises:
        FormatError: it is damaged, or an array is not what its name says.
    """
    arrays = _arrays(name, content, limit_bytes)
    table, pairs = arrays.pop("nodes", None), arrays.pop("dofs", None)
    nodes = dofs = None
    if table is not None:
        if table.ndim != 2 or table.shape[1] != 4:
            raise FormatError(
                f"{name} nodes", f"has the shape {table.shape}, expected (n, 4): number, x, y, z"
            )
        nodes = integers(f"{name} nodes", table[:, 0]), table[:, 1:].astype(float)
    if pairs is not None:
        if (
            pairs.ndim != 2
            or pairs.shape[1] != 2
            or not np.all((pairs[:, 1] >= 1) & (pairs[:, 1] <= DOFS))
        ):
            raise FormatError(
                f"{name} dofs", f"has the shape {pairs.shape}, expected (d, 2): node, dof 1 … 6"
            )
        numbers, own = integers(f"{name} dofs", pairs).T
        dofs = code(numbers, own - 1)
    stems = dict.fromkeys(_stem(array) for array in arrays)
    return {stem: _entries(f"{name} {stem}", stem, arrays) for stem in stems}, nodes, dofs


def _arrays(name: str, content: bytes, limit_bytes: int) -> dict[str, Array]:
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
    except zipfile.BadZipFile as error:
        raise FormatError(name, "is no npz archive") from error
    with archive:
        members = members_of(archive)
        if sum(member.file_size for member in members) > limit_bytes:
            raise FormatError(name, f"holds more than {limit_bytes} bytes")
        arrays = {
            member.filename.removesuffix(".npy"): read_array(archive, member) for member in members
        }
    for array, values in arrays.items():
        if values.dtype.kind not in "fiu":
            raise FormatError(f"{name} {array}", f"is {values.dtype}, expected real numbers")
    return arrays


def _stem(array: str) -> str:
    head, _, part = array.rpartition("_")
    return head if part in _PARTS else array


def _entries(place: str, stem: str, arrays: dict[str, Array]) -> Entries:
    if stem in arrays:
        matrix = np.asarray(arrays[stem], dtype=float)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
            raise FormatError(place, f"has the shape {matrix.shape}, expected (d, d)")
        rows, columns = np.nonzero(matrix)
        return Entries(rows, columns, matrix[rows, columns], is_half=False, size=len(matrix))
    parts = [arrays.get(f"{stem}_{part}") for part in _PARTS]
    if any(part is None or part.ndim != 1 for part in parts):
        raise FormatError(
            place, f"needs {', '.join(f'{stem}_{part}' for part in _PARTS)}, each of one dimension"
        )
    data, indices, starts = (np.asarray(part) for part in parts)
    size = len(starts) - 1
    try:
        sparse = scipy.sparse.csr_array(
            (data.astype(float), integers(place, indices), integers(place, starts)), (size, size)
        )
        sparse.check_format(full_check=True)
    except (ValueError, IndexError) as error:
        raise FormatError(place, f"is no sparse matrix: {error}") from error
    entries = sparse.tocoo()
    return Entries(entries.coords[0], entries.coords[1], entries.data, is_half=False, size=size)


_MARK = "%%MatrixMarket"


def read_text(name: str, content: bytes) -> Entries:
    """Matrix Market; rows, columns and values as CalculiX stores them; node, dof, node, dof, value
    as Abaqus does.

    Raises:
        FormatError: it is none of these, or holds more or fewer entries than it says.
    """
    text = content.removeprefix(BOM_UTF8).decode("latin-1")
    if text[: len(_MARK)].lower() == _MARK.lower():
        return _market(name, text)
    lines = [
        line
        for line in text.splitlines()
        if line.strip() and not line.lstrip().startswith(("*", "#", "%"))
    ]
    table = _numbers(name, " ".join(lines).replace(",", " "))
    width = len(lines[0].replace(",", " ").split()) if lines else 0
    if width not in (3, 5) or table.size % width:
        raise FormatError(
            name, "is no table of row, column, value nor of node, dof, node, dof, value"
        )
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
            f"{name} line 1",
            f"is {head[:60]!r}, expected %%MatrixMarket matrix coordinate real symmetric",
        )
    if words[3] not in ("real", "integer", "double") or words[4] not in ("general", "symmetric"):
        raise FormatError(
            f"{name} line 1", f"says {words[3]} {words[4]}, expected real, and general or symmetric"
        )
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
        raise FormatError(
            name, f"holds {table.size} numbers, and says that it has {stated}; it seems to be cut"
        )
    if is_sparse:
        table = table.reshape(-1, 3)
        places = integers(name, table[:, :2]) - 1
        return Entries(places[:, 0], places[:, 1], table[:, 2], is_half=is_half, size=count)
    columns, rows = np.triu_indices(count) if is_half else np.indices((count, count)).reshape(2, -1)
    return Entries(rows, columns, table, is_half=is_half, size=count)


def read_nodes(name: str, content: bytes) -> tuple[Integers, Floats]:
    """Numbers and coordinates of a table with the columns `node`, `x`, `y`, `z`."""
    rows = _table(name, content, ("node", "x", "y", "z"))
    numbers = integers(
        name,
        np.array([whole(cells[0], f"{name} {place}, node") for place, cells in rows], dtype=float),
    )
    places = [[real(cell, f"{name} {place}, {axis}") for axis, cell in zip("xyz", cells[1:], strict=True)]
              for place, cells in rows]  # fmt: skip
    return numbers, np.array(places, dtype=float).reshape(-1, 3)


def read_dofs(name: str, content: bytes) -> Integers:
    """(d,) codes of the dofs of a table with the columns `node`, `dof`, or of lines `node.dof` as
    CalculiX stores them.
    """
    text = content.decode("latin-1")
    if name.lower().endswith(".dof"):
        pairs = [
            (f"line {at}", line.strip().split("."))
            for at, line in enumerate(text.splitlines(), 1)
            if line.strip()
        ]
    else:
        pairs = _table(name, content, ("node", "dof"))
    rows = []
    for place, cells in pairs:
        if len(cells) != 2:
            raise FormatError(
                f"{name} {place}",
                f"is {'.'.join(cells)[:40]!r}, expected a node and a dof such as 17.3",
            )
        dof = whole(cells[1], f"{name} {place}, dof")
        if not 1 <= dof <= DOFS:
            raise FormatError(f"{name} {place}", f"has the dof {dof}, expected 1 … 6")
        rows.append((whole(cells[0], f"{name} {place}, node"), dof - 1))
    nodes, dofs = integers(name, np.array(rows, dtype=float)).reshape(-1, 2).T
    return code(nodes, dofs)


def _table(name: str, content: bytes, columns: tuple[str, ...]) -> list[tuple[str, list[str]]]:
    """Lines and cells of the columns, in this order."""
    try:
        header, rows = read_rows(content, columns)
        places = [header.index(column) for column in columns]
        return [
            (f"line {line}", [cells[at] for at in places])
            for line, cells in whole_rows(header, rows)
        ]
    except FormatError as error:
        raise FormatError(f"{name} {error.place}".rstrip(), error.message) from error


def _numbers(name: str, text: str) -> Floats:
    text = text.replace("D", "E").replace("d", "e")
    if not text.strip():
        return np.zeros(0)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings(
                "error", "string or file could not be read to its end", DeprecationWarning
            )
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


_SQUARE, _SYMMETRIC = 1, 6


def read_dmig(content: bytes) -> tuple[dict[str, Entries], tuple[Integers, Floats] | None]:
    """Entries by the matrix's name, and numbers and places of the grids.

    Raises:
        FormatError: a card is wrong, with its line; a matrix is complex or not square; a grid has
            axes of its own.
    """
    cards = [card for card in cards_of(split_deck(content, None).bulk) if isinstance(card, Card)]
    heads: dict[str, bool] = {}
    entries: dict[str, list[tuple[int, int, float]]] = {}
    for card in cards:
        if card.name != "DMIG":
            continue
        name = card.text(0)
        if card.text(1) == "0" and name not in heads:
            heads[name] = _is_half(card)
            entries[name] = []
        elif name not in heads:
            raise card.wrong(0, "NAME", "a matrix whose header, with 0 in field 3, stands before")
        else:
            entries[name] += _column(card)
    matrices = {name: _punched(rows, heads[name]) for name, rows in entries.items()}
    return matrices, _places(cards)


def _is_half(card: Card) -> bool:
    form = card.integer(2, "IFO")
    if form not in (_SQUARE, _SYMMETRIC):
        raise card.wrong(2, "IFO", "1 or 6, a square or symmetric matrix")
    if card.integer(3, "TIN") not in (1, 2):
        raise card.wrong(3, "TIN", "1 or 2, real numbers")
    return form == _SYMMETRIC


def _column(card: Card) -> Iterable[tuple[int, int, float]]:
    """Codes of row and column, and value, of a card."""
    column = _dof(card, 1, "GJ")
    for at in range(4, len(card), 4):
        if card.text(at):
            yield _dof(card, at, "G"), column, card.real(at + 2, "A")


def _dof(card: Card, index: int, what: str) -> int:
    grid, component = card.integer(index, what), card.integer(index + 1, f"C of {what}", 0)
    if not 0 <= component <= 6:
        raise card.wrong(index + 1, f"C of {what}", "a component of 1 … 6")
    return int(code(np.int64(grid), np.int64(max(component, 1) - 1)))  # type: ignore[arg-type]


def _punched(rows: list[tuple[int, int, float]], is_half: bool) -> Entries:
    codes = np.array([row[:2] for row in rows], dtype=np.int64).reshape(-1, 2)
    values = np.array([row[2] for row in rows], dtype=float)
    return Entries(codes[:, 0], codes[:, 1], values, is_labelled=True, is_half=is_half)


def _places(cards: list[Card]) -> tuple[Integers, Floats] | None:
    own = [card for card in cards if card.name == "GRID"]
    if not own:
        return None
    defaults = next((card for card in cards if card.name == "GRDSET"), None)
    grids = read_grids(
        own, defaults, [card for card in cards if card.name[:5] in ("CORD1", "CORD2")]
    )
    for row in grids.displacement:
        card = next(card for card in own if card.integer(0, "ID") == grids.numbers[row])
        raise card.wrong(5, "CD", "none: rows of the matrices must lie along the axes of the model")
    return grids.numbers, grids.places
