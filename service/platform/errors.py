"""What can go wrong in the service, without a word of HTTP.

    ServiceError
    ├── NotFound               no such thing, or not yours to see
    ├── Unauthorized           no key, or not a valid one
    ├── Forbidden              you see it but may not do this
    ├── Conflict               contradicts what is stored
    ├── Gone                   bytes that a retention rule has deleted
    ├── Invalid                the input is wrong; lists every fault with its JSON pointer
    │   └── Unusual            it is possible, and probably in another unit
    ├── PayloadTooLarge        more bytes than the operator allows
    │   └── QuotaExceeded      more bytes than the project may store
    ├── UnsupportedMediaType   a body of a kind that is not read
    ├── NotAcceptable          an answer of a kind that is not written
    ├── PreconditionFailed     If-Match names an older version
    ├── PreconditionRequired   If-Match is missing
    ├── TooSlow                the body of the request came too slowly
    ├── Later                  it may succeed when it is sent again; says when
    │   ├── TooManyRequests    a limit on the number of something is reached
    │   └── Unavailable        too much to do, the database does not answer, or its schema is not this version's
    ├── NotFinite              a result has a number that JSON lacks
    └── Damaged                stored bytes are not the ones that were stored

Every message says what was found, what was expected and, where there is something, what to do.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime

MOST_FAULTS = 50
"""Faults of one input that are listed; of more, their number is said."""


class ServiceError(Exception):
    """Root of all errors that the service raises on purpose."""


class NotFound(ServiceError):
    """There is no such thing, or it belongs to other people: the answer does not say which."""

    def __init__(self, what: str, key: object = None) -> None:
        super().__init__(f"no {what}" if key is None else f"no {what} {key}")


@contextmanager
def not_found_as(what: str, key: object) -> Iterator[None]:
    """Within the block, whatever is not found is reported as this thing: the caller may not learn
    what it belongs to.
    """
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


class NotFinite(ServiceError):
    """A document that would be stored has NaN or Infinity, which neither JSON nor PostgreSQL can
    hold.
    """

    def __init__(self, places: Sequence[str]) -> None:
        super().__init__(
            f"the result has no finite number at {', '.join(places)}; the data and what is stated"
            " of them leave it open: look for a standard deviation or a band that is far too wide"
        )


@dataclass(frozen=True)
class Fault:
    """One wrong value.

    Attributes:
        pointer: JSON pointer (RFC 6901) into the body, such as `/geometry/length_m`; the name of a
            query parameter or header where it is not in the body.
        detail: what was found and what was expected.
    """

    pointer: str
    detail: str


def _escape(token: object) -> str:
    """One step of a JSON pointer, escaped as RFC 6901 wants it; safe to print."""
    text = str(token).encode("utf-8", "replace").decode("utf-8")
    return text.replace("~", "~0").replace("/", "~1")


def pointer(steps: Iterable[object]) -> str:
    """The JSON pointer (RFC 6901) of a place: a `/` in a step is written `~1`, a `~` is written
    `~0`.

    >>> pointer(["jobs", 3, "a/b"])
    '/jobs/3/a~1b'
    """
    return "".join(f"/{_escape(step)}" for step in steps)


class Invalid(ServiceError):
    """The input is wrong. `Invalid("/geometry/length_m", "is 0, expected more")`, or a list of
    faults.

    Attributes:
        faults: the first `MOST_FAULTS` of them.
        count: how many there are.
    """

    def __init__(
        self, pointer: str | Sequence[Fault], detail: str = "", *, count: int | None = None
    ) -> None:
        faults = [Fault(pointer, detail)] if isinstance(pointer, str) else pointer
        self.faults = list(faults[:MOST_FAULTS])
        self.count = len(faults) if count is None else count
        more = (
            f"; and {self.count - len(self.faults)} more faults"
            if self.count > len(self.faults)
            else ""
        )
        super().__init__(
            "; ".join(f"{f.pointer or 'body'}: {f.detail}" for f in self.faults) + more
        )

    def __reduce__(self) -> tuple[Callable[..., Invalid], tuple[list[Fault], int]]:
        """Survive pickling."""
        return _invalid, (self.faults, self.count)


class Unusual(Invalid):
    """Numbers of the input are probably in another unit than the contract's; whoever means them
    confirms them.
    """


def _invalid(faults: list[Fault], count: int) -> Invalid:
    return Invalid(faults, count=count)


class PayloadTooLarge(ServiceError):
    """The body has more bytes than the operator allows."""


class QuotaExceeded(PayloadTooLarge):
    """The project would store more bytes than the operator allows it."""

    def __init__(self, used: int, allowed: int, size: int) -> None:
        super().__init__(
            f"the project stores {used} of the {allowed} bytes that it may, and this needs {size}"
            " more; purge what nobody needs, or have the operator raise"
            " MODALBASE_PROJECT_QUOTA_BYTES"
        )
        self.used, self.allowed, self.size = used, allowed, size

    def __reduce__(self) -> tuple[type[QuotaExceeded], tuple[int, int, int]]:
        """Survive pickling."""
        return type(self), (self.used, self.allowed, self.size)


class UnsupportedMediaType(ServiceError):
    """The body is of a kind that is not read here."""


class NotAcceptable(ServiceError):
    """The answer cannot be written as the client wants it."""


class PreconditionFailed(ServiceError):
    """The thing was changed since the version that If-Match names."""


def deleted_by_rule(what: str, when: datetime) -> str:
    """That bytes are gone.

    >>> deleted_by_rule("original", datetime(2026, 3, 2))
    'original deleted by the retention rule on 2026-03-02'
    """
    return f"{what} deleted by the retention rule on {when:%Y-%m-%d}"


class Gone(ServiceError):
    """Bytes were deleted by a retention rule; what was made of them stays."""


def require_bytes(what: str, deleted_at: datetime | None) -> None:
    """Refuse to give bytes that are gone.

    Raises:
        Gone: they are.
    """
    if deleted_at is not None:
        raise Gone(deleted_by_rule(what, deleted_at))


class PreconditionRequired(ServiceError):
    """An edit must say with If-Match which version it edits."""


class Later(ServiceError):
    """The request may succeed when it is sent again later.

    Attributes:
        retry_after: seconds to wait.
    """

    def __init__(self, message: str, *, retry_after: int = 2) -> None:
        super().__init__(message)
        self.retry_after = retry_after


class TooManyRequests(Later):
    """A limit on the number of something is reached."""


class Unavailable(Later):
    """The service cannot answer now."""


class TooSlow(ServiceError):
    """The body of the request came too slowly."""


class Damaged(ServiceError):
    """Stored bytes do not have the SHA-256 that was recorded with them."""

    def __init__(self, what: str, sha256: bytes) -> None:
        super().__init__(
            f"the stored {what} {sha256.hex()} fails its checksum; restore it from a backup"
        )
        self.what, self.sha256 = what, sha256

    def __reduce__(self) -> tuple[type[Damaged], tuple[str, bytes]]:
        """Survive pickling."""
        return type(self), (self.what, self.sha256)


def verified(data: bytes, sha256: bytes, what: str) -> bytes:
    """The bytes themselves.

    Raises:
        Damaged: their digest is another one.
    """
    if hashlib.sha256(data).digest() != sha256:
        raise Damaged(what, sha256)
    return data
