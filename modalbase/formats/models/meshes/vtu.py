"""VTK's unstructured grids in XML, `.vtu`: text, base64 or appended, plain or packed by zlib
(Kitware, VTK File Formats).
"""

import base64
import binascii
import re
import zlib
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.meshes import MeshFile
from modalbase.formats.models.meshes.cells import whole_numbers
from modalbase.formats.models.meshes.vtk import Grid, mesh_of
from modalbase.formats.models.model import Floats, Integers

MOST_BYTES = 500_000_000
"""Of an array, unpacked."""

_TYPES = {f"{kind}{8 * size}": f"{letter}{size}" for kind, letter in (("Int", "i"), ("UInt", "u"), ("Float", "f"))
          for size in (1, 2, 4, 8)}  # fmt: skip
_APPENDED = re.compile(rb"<AppendedData[^>]*>\s*_(.*)</AppendedData>", re.DOTALL)
_NAME = re.compile(rb"<!-- set (\d{1,9}): (.*?) -->")


def read_vtu(content: bytes) -> MeshFile:
    """Cells of an unstructured grid by set; names of sets from the comments that we write.

    Raises:
        FormatError: it is no such file, or damaged; says the line of broken XML, or the array.
    """
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise FormatError("", "has a DOCTYPE, which no VTU file has")
    appended = _APPENDED.search(content)
    text = (
        content if appended is None else content[: appended.start(1)] + content[appended.end(1) :]
    )
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise FormatError("", f"is no XML that can be read: {error}") from None
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        raise FormatError(
            "", f"is {root.get('type') or root.tag}, expected VTKFile of the type UnstructuredGrid"
        )
    pieces = root.findall("UnstructuredGrid/Piece")
    if len(pieces) != 1:
        raise FormatError("", f"has {len(pieces)} pieces, expected one; merge them")
    grid = _Arrays(root, b"" if appended is None else appended.group(1)).grid(pieces[0])
    grid.names = {
        int(number): name.decode("utf-8", "replace") for number, name in _NAME.findall(content)
    }
    return mesh_of(grid)


class _Arrays:
    """What holds for all arrays of a file."""

    def __init__(self, root: ElementTree.Element, appended: bytes) -> None:
        order = ">" if root.get("byte_order") == "BigEndian" else "<"
        self._order, self._head = (
            order,
            np.dtype(order + ("u8" if root.get("header_type") == "UInt64" else "u4")),
        )
        self._packed = root.get("compressor")
        tag = root.find("AppendedData")
        self._appended, self._is_raw = appended, tag is not None and tag.get("encoding") == "raw"
        if self._packed not in (None, "vtkZLibDataCompressor"):
            raise FormatError("", f"is packed by {self._packed}; save it by zlib or unpacked")

    def grid(self, piece: ElementTree.Element) -> Grid:
        """Points, cells and cell data of a piece."""
        grid = Grid(data=dict(self._of(piece.find("CellData"))))
        points = [values for _, values in self._of(piece.find("Points"))]
        cells = dict(self._of(piece.find("Cells")))
        if not points or points[0].ndim != 2 or points[0].shape[1] != 3:
            raise FormatError("Points", "has no array of three components")
        grid.points = points[0]
        if "faces" in cells:
            raise FormatError("Cells", "has faces: polyhedra are solids, which are not read")
        grid.connectivity, grid.ends, grid.types = (
            _indices(name, cells.get(name)) for name in ("connectivity", "offsets", "types")
        )
        for counted, name, array in (
            ("Points", "Points", grid.points),
            ("Cells", "types", grid.types),
        ):
            count = piece.get(f"NumberOf{counted}", str(len(array))).strip()
            if count != str(len(array)):
                raise FormatError(
                    f"NumberOf{counted}",
                    f"says {count}, but {name} has {len(array)}; the file seems to be cut",
                )
        return grid

    def _of(self, parent: ElementTree.Element | None) -> Iterator[tuple[str, Floats]]:
        for each in () if parent is None else parent.findall("DataArray"):
            name, width = (
                each.get("Name", parent.tag if parent is not None else ""),
                each.get("NumberOfComponents", "1"),
            )
            item = _TYPES.get(each.get("type", ""))
            if item is None or not width.isdecimal() or not 1 <= int(width) <= 1000:
                raise FormatError(
                    name,
                    f"is of the type {each.get('type')} with {width} components, which is not read",
                )
            values = self._values(name, each, np.dtype(self._order + item))
            if values.size % int(width):
                raise FormatError(name, f"has {values.size} numbers, which are no rows of {width}")
            yield name, values.reshape(-1, int(width)) if int(width) > 1 else values

    def _values(self, name: str, array: ElementTree.Element, kind: np.dtype[np.void]) -> Floats:
        form = array.get("format", "ascii")
        if form == "ascii":
            try:
                return np.array((array.text or "").split(), dtype=float)
            except ValueError as error:
                raise FormatError(name, f"holds what is no number: {error}") from None
        raw, text = False, b"".join((array.text or "").encode("ascii", "replace").split())
        if form == "appended":
            offset = array.get("offset", "")
            if not offset.isdecimal() or int(offset) >= len(self._appended):
                raise FormatError(
                    name,
                    f"lies at {offset!r} of {len(self._appended)} appended bytes; the file seems to"
                    " be cut",
                )
            raw, text = self._is_raw, self._appended[int(offset) :]
        try:
            content = self._unpacked(name, text, raw=raw)
            return np.frombuffer(content, kind).astype(float)
        except (binascii.Error, zlib.error, ValueError) as error:
            raise FormatError(name, f"is damaged: {error}") from None

    def _unpacked(self, name: str, text: bytes, *, raw: bool) -> bytes:
        """The bytes of an array: how many there are, or the sizes of packed blocks, stand before
        them.
        """

        def part(start: int, count: int) -> bytes:
            if count > MOST_BYTES:
                raise FormatError(
                    name, f"has {count} bytes, more than the {MOST_BYTES} that are read"
                )
            chunk = (
                text[start : start + count]
                if raw
                else base64.b64decode(text[start : start + _coded(count)])[:count]
            )
            if len(chunk) != count:
                raise FormatError(
                    name, f"has {len(chunk)} bytes and says {count}; the file seems to be cut"
                )
            return chunk

        size = self._head.itemsize
        (first,) = np.frombuffer(part(0, size), self._head).tolist()
        if self._packed is None:
            return part(0, size + first)[size:]
        head = part(0, size * (3 + first))
        sizes = np.frombuffer(head, self._head).tolist()[1:]
        at, unpacked = len(head) if raw else _coded(len(head)), b""
        packed, begins = part(at, sum(sizes[2:])), 0
        if first * sizes[0] > MOST_BYTES:
            raise FormatError(
                name,
                f"has {first} blocks of {sizes[0]} bytes, more than the {MOST_BYTES} that are read",
            )
        blocks = []
        for count in sizes[2:]:
            blocks.append(
                zlib.decompressobj().decompress(packed[begins : begins + count], sizes[0] + 1)
            )
            begins += count
        unpacked = b"".join(blocks)
        whole = first * sizes[0] if not sizes[1] else (first - 1) * sizes[0] + sizes[1]
        if len(unpacked) != max(whole, 0):
            raise FormatError(name, f"unpacks to {len(unpacked)} bytes and says {whole}")
        return unpacked


def _coded(count: int) -> int:
    """Letters of base64 for so many bytes."""
    return 4 * -(-count // 3)


def _indices(name: str, values: Floats | None) -> Integers:
    if values is None or values.ndim != 1 or (numbers := whole_numbers(values)) is None:
        raise FormatError(name, "is missing, or holds what is no whole number")
    return numbers
