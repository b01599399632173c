"""What can go wrong in the core.

    FecoreError
    ├── InputError            a value that was handed in is wrong; names the field
    │   └── OffSpecimenError  a point lies off the specimen
    ├── ModelError            the finite element model cannot be built or solved
    ├── IdentificationError   the measured data do not support an identification
    └── UpdatingError         an update did not converge; carries the best iterate

Every message says what was found, what was expected and, where there is something, what to do.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager


class FecoreError(Exception):
    """Root of all errors that the core raises on purpose."""


class InputError(FecoreError):
    """A value handed in is wrong.

    Attributes:
        field: dotted name of the faulty field, such as `geometry.thickness_m`.
    """

    def __init__(self, field: str, message: str) -> None:
        super().__init__(f"{field}: {message}")
        self.field = field
        self.message = message

    def __reduce__(self) -> tuple[type["InputError"], tuple[object, ...]]:
        """Survive pickling: the error crosses from the numerical child process to its parent."""
        return type(self), (self.field, self.message)


@contextmanager
def within(part: str) -> Iterator[None]:
    """Within the block, a faulty field is named as one of a part: `highest_hz` is
    `tests.1.highest_hz` within `tests.1`.
    """
    try:
        yield
    except InputError as error:
        raise InputError(f"{part}.{error.field}", error.message) from error


class OffSpecimenError(InputError):
    """A point lies off the specimen.

    Attributes:
        index: its place among the points handed in.
    """

    def __init__(self, index: int, message: str) -> None:
        super().__init__(f"points[{index}]", message)
        self.index = index

    def __reduce__(self) -> tuple[type["InputError"], tuple[object, ...]]:
        """Survive pickling, as `InputError`."""
        return type(self), (self.index, self.message)


class ModelError(FecoreError):
    """The finite element model cannot be built or solved."""


class IdentificationError(FecoreError):
    """The measured data do not support an identification; the message says what was seen and what
    to try.
    """


class UpdatingError(FecoreError):
    """An update did not converge.

    Attributes:
        best: parameters of the best iterate, by name, SI.
        history: cost of each iterate, first to last.
    """

    def __init__(self, message: str, best: Mapping[str, float], history: tuple[float, ...]) -> None:
        super().__init__(message)
        self.message = message
        self.best = dict(best)
        self.history = history

    @property
    def details(self) -> dict[str, object]:
        """What a failed job keeps: the best iterate and the misfit's history."""
        return {"best": self.best, "history": list(self.history)}

    def __reduce__(
        self,
    ) -> tuple[type["UpdatingError"], tuple[str, dict[str, float], tuple[float, ...]]]:
        """Survive pickling, as `InputError`."""
        return type(self), (self.message, self.best, self.history)
