"""Reading the file of a user's model: which files it is of, and which reader has them."""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import PurePosixPath, PureWindowsPath
from typing import TypeVar

from modalbase.formats.errors import FormatError
from modalbase.formats.foreign import HEAD_BYTES, MODELS, refuse_foreign
from modalbase.formats.models.bdf import read_bdf
from modalbase.formats.models.inp import read_inp
from modalbase.formats.models.model import FiniteElementModel
from modalbase.formats.npy import members_of
from service.compute.models.meshes import MESHES
from service.platform.errors import Fault, Invalid

ZIP, NPZ = ".zip", ".npz"
"""End of the name of an archive of a deck and what it includes, or of matrices; and of matrices in
one file.
"""

MOST_FILES, MOST_BYTES = 1000, 500_000_000  # of an archive, unpacked

_INCLUDE = re.compile(
    rb"(?im)^[ \t]*\*?[ \t]*INCLUDE[ \t]*(?:,[ \t]*INPUT[ \t]*=[ \t]*)?['\"]?([^'\"\r\n,]+)"
)

READERS: Mapping[str, Callable[[bytes, dict[str, bytes]], FiniteElementModel]] = {
    ".inp": read_inp,
    **dict.fromkeys((".bdf", ".dat", ".nas", ".fem"), read_bdf),
}
"""By the end of a file's name."""

_LANGUAGES = (
    (re.compile(rb"(?im)^[ \t]*\*[ \t]*(HEADING|NODE|PART|MATERIAL)[ \t]*(,|\r?$)"), read_inp),
    (re.compile(rb"(?im)^[ \t]*(CEND|BEGIN[ \t]+BULK|GRID\*?[ \t,]+\d+.*)[ \t]*\r?$"), read_bdf),
)
"""What shows the language of a deck, whatever its name."""

Read = TypeVar("Read")


def parsed(content: bytes, filename: str) -> FiniteElementModel:
    """The model of a file, in its own units.

    Raises:
        Invalid: no reader knows its name, or the reader finds it wrong.
    """
    deck = unpacked(content, filename)
    reader = reader_of(deck.name, deck.content)
    return faults_of(lambda: reader(deck.content, deck.included))


@dataclass(frozen=True)
class Deck:
    """A deck, its name, and the files that it includes, by the names that its lines say."""

    name: str
    content: bytes
    included: dict[str, bytes]


def unpacked(content: bytes, filename: str) -> Deck:
    """The deck of a file: itself, or of a zip the one that no other of its files includes.

    Raises:
        Invalid: it is no zip, has more than it may, or no or several such decks.
    """
    files = files_of(content, filename)
    if PurePosixPath(filename).suffix.lower() != ZIP:
        return Deck(filename, content, {})
    named = {
        PureWindowsPath(each.decode("latin-1")).name
        for text in files.values()
        for each in _INCLUDE.findall(text)
    }
    decks = [name for name in files if PurePosixPath(name).suffix.lower() in READERS]
    mains = [name for name in decks if PurePosixPath(name).name not in named]
    for name, text in files.items() if not mains else ():
        faults_of(partial(refuse_foreign, text[:HEAD_BYTES] or b"\0", name, MODELS, name))
    if len(mains) != 1:
        raise Invalid(
            "file",
            f"has {', '.join(mains) or 'no deck'}, expected one deck that no other file of it"
            " includes",
        )
    folder = PurePosixPath(mains[0]).parent
    return Deck(
        mains[0],
        files[mains[0]],
        {_beside(name, folder): text for name, text in files.items() if name != mains[0]},
    )


def files_of(content: bytes, filename: str) -> dict[str, bytes]:
    """The files of a zip by name, or the file itself.

    Raises:
        Invalid: it is no zip, or has more than it may.
    """
    if PurePosixPath(filename).suffix.lower() != ZIP:
        return {filename: content}
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            infos = [info for info in members_of(archive) if not info.is_dir()]
            if len(infos) > MOST_FILES or sum(info.file_size for info in infos) > MOST_BYTES:
                raise Invalid(
                    "file", f"has more than {MOST_FILES} files, or {MOST_BYTES // 10**6} MB of them"
                )
            return {info.filename: archive.read(info) for info in infos}
    except (
        FormatError,
        zipfile.BadZipFile,
        RuntimeError,
        NotImplementedError,
        zlib.error,
    ) as error:
        raise Invalid("file", f"is no zip that can be read: {error}") from None


def _beside(name: str, folder: PurePosixPath) -> str:
    """A file's name as a deck in a folder says it."""
    path = PurePosixPath(name)
    return str(path.relative_to(folder)) if path.is_relative_to(folder) else name


def repacked(content: bytes, filename: str, changed: Mapping[str, bytes]) -> bytes:
    """A file as it was sent, with the deck's files that changed; the deck's own has the empty
    name.
    """
    if PurePosixPath(filename).suffix.lower() != ZIP:
        return changed[""]
    deck, buffer = unpacked(content, filename), io.BytesIO()
    folder = PurePosixPath(deck.name).parent
    with (
        zipfile.ZipFile(io.BytesIO(content)) as archive,
        zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as out,
    ):
        for info in archive.infolist():
            key = "" if info.filename == deck.name else _beside(info.filename, folder)
            out.writestr(info, changed.get(key, archive.read(info)))
    return buffer.getvalue()


def reader_of(
    filename: str, content: bytes = b""
) -> Callable[[bytes, dict[str, bytes]], FiniteElementModel]:
    """The reader of a deck: by the language that its first lines show, else by its name.

    Args:
        filename: what its sender calls it.
        content: the deck; none where its name alone is known.

    Raises:
        Invalid: there is none; of another program's file says what to export instead.
    """
    if content:
        faults_of(lambda: refuse_foreign(content[:HEAD_BYTES], filename, MODELS))
    reader = READERS.get(PurePosixPath(filename).suffix.lower())
    if reader is None:
        faults_of(lambda: refuse_foreign(b"", filename, MODELS))
        raise Invalid(
            "filename",
            f"{filename!r} ends in none of {', '.join([*READERS, *MESHES, ZIP, NPZ])}: which kind"
            " of deck is it?",
        )
    spoken = [reader for shows, reader in _LANGUAGES if shows.search(content[:HEAD_BYTES])]
    return spoken[0] if len(spoken) == 1 else reader


def require_deck(filename: str) -> None:
    """Refuse a file whose name's end says neither a deck, a mesh nor an archive.

    Raises:
        Invalid: as said.
    """
    if PurePosixPath(filename).suffix.lower() not in (ZIP, NPZ, *MESHES):
        reader_of(filename)


def faults_of(read: Callable[[], Read]) -> Read:
    """What a reader returns; its faults name lines of the file."""
    try:
        return read()
    except FormatError as error:
        raise Invalid(
            [
                (
                    Fault(place.replace(".", "/"), what)
                    if place.split(".")[0] in ("units", "filename", "sections", "accept")
                    else Fault("file", f"{place}: {what}" if place else what)
                )
                for place, what in error.faults
            ]
        ) from None
