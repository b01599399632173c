"""A deck and the files that it includes, as lines."""

from codecs import BOM_UTF8
from collections.abc import Iterable
from pathlib import PureWindowsPath

DEEPEST_INCLUDE = 10


def lines_of(content: bytes) -> list[str]:
    """Lines without their ends; a character is a byte, so that columns are too, and a mark of byte
    order is left out.
    """
    return [line.decode("latin-1") for line in content.removeprefix(BOM_UTF8).splitlines()]


def included_file(name: str, included: Iterable[str]) -> str | None:
    """The file that a deck means, by its name, else by the last part of its path in capitals or
    small letters.
    """
    names = list(included)
    basename = PureWindowsPath(name).name.lower()
    return (
        name
        if name in names
        else next((one for one in names if PureWindowsPath(one).name.lower() == basename), None)
    )
