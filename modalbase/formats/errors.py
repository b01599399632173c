"""What can be wrong with a file that is not UFF, whose errors are
`modalbase.formats.uff.UffError`.
"""

from __future__ import annotations


class FormatError(Exception):
    """A file cannot be read, or what is said of it is wrong; every fault is in the message.

    Attributes:
        faults: place and what is wrong there. A place is a line, a column, the name of an array or
            of an argument (with dots where it lies deeper), or empty for the whole file.
    """

    def __init__(self, place: str | list[tuple[str, str]], message: str = "") -> None:
        self.faults = [(place, message)] if isinstance(place, str) else place
        super().__init__(
            "; ".join(f"{where}: {what}" if where else what for where, what in self.faults)
        )

    @property
    def place(self) -> str:
        """Where the first fault is."""
        return self.faults[0][0]

    @property
    def message(self) -> str:
        """What the first fault is."""
        return self.faults[0][1]

    def __reduce__(self) -> tuple[type[FormatError], tuple[list[tuple[str, str]]]]:
        """Survive pickling."""
        return type(self), (self.faults,)
