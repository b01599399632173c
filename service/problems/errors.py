"""What can go wrong in the service, without a word of HTTP.

    ServiceError
    ├── NotFound               no such thing, or not yours to see
    ├── Unauthorized           no key, or not a valid one
    ├── Forbidden              you see it but may not do this
    ├── Conflict               contradicts what is stored
    ├── Invalid                the input is wrong; lists every fault with its JSON pointer
    ├── PayloadTooLarge        more bytes than the operator allows
    ├── UnsupportedMediaType   a body of a kind that is not read
    ├── NotAcceptable          an answer of a kind that is not written
    ├── PreconditionFailed     If-Match names an older version
    ├── PreconditionRequired   If-Match is missing
    ├── TooManyRequests        a limit on the number of something is reached
    └── Unavailable            the database does not answer, or its schema is not this version's

Every message says what was found, what was expected and, where there is something, what to do.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


class ServiceError(Exception):
    """Root of all errors that the service raises on purpose."""


class NotFound(ServiceError):
    """There is no such thing, or it belongs to other people: the two are not told apart."""

    def __init__(self, what: str, key: object = None) -> None:
        super().__init__(f"no {what}" if key is None else f"no {what} {key}")


@contextmanager
def not_found_as(what: str, key: object) -> Iterator[None]:
    """Within: what is not found is told as this thing, since what it belongs to is not the caller's to hear of."""
    try:
        yield
    except NotFound:
        raise NotFound(what, key) from None


class Unauthorized(ServiceError):
    """The request carries no valid API key."""


class Forbidden(ServiceError):
    """The user sees the thing but has not the role that this needs."""


class Conflict(ServiceError):
    """The request contradicts what is stored."""


@dataclass(frozen=True)
class Fault:
    """One wrong value.

    Attributes:
        pointer: JSON pointer (RFC 6901) into the body, such as `/geometry/length_m`; the name of a query parameter or
            header where it is not in the body.
        detail: what was found and what was expected.
    """

    pointer: str
    detail: str


class Invalid(ServiceError):
    """The input is wrong. `Invalid("/geometry/length_m", "is 0, expected more")`, or a list of faults.

    Attributes:
        faults: every fault found.
    """

    def __init__(self, pointer: str | list[Fault], detail: str = "") -> None:
        self.faults = [Fault(pointer, detail)] if isinstance(pointer, str) else pointer
        super().__init__("; ".join(f"{f.pointer or 'body'}: {f.detail}" for f in self.faults))

    def __reduce__(self) -> tuple[type[Invalid], tuple[list[Fault]]]:
        """Survive pickling."""
        return type(self), (self.faults,)


class PayloadTooLarge(ServiceError):
    """The body has more bytes than the operator allows."""


class UnsupportedMediaType(ServiceError):
    """The body is of a kind that is not read here."""


class NotAcceptable(ServiceError):
    """The answer cannot be written as the client wants it."""


class PreconditionFailed(ServiceError):
    """The thing was changed since the version that If-Match names."""


class PreconditionRequired(ServiceError):
    """An edit must say with If-Match which version it edits."""


class TooManyRequests(ServiceError):
    """A limit on the number of something is reached."""


class Unavailable(ServiceError):
    """The service cannot answer now."""
