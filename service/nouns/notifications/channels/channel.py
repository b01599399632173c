"""What a channel of alarms is made of."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from service.nouns.notifications.tables import Delivery
from service.platform.settings import Settings

STEP_SECONDS = 10.0  # to connect, or until the next bytes of an answer
KEPT_CHARACTERS = 300  # of a receiver's answer


@dataclass(frozen=True)
class Receiver:
    """Where one message goes."""

    address: str
    secret: str | None = None  # that signs it, of channels that sign


@dataclass(frozen=True)
class Outcome:
    """What became of an attempt."""

    status: int | None  # HTTP status, where there was one
    error: str | None  # why it failed; None where it was delivered

    @classmethod
    def of(cls, error: Exception) -> "Outcome":
        """An attempt that met an error."""
        return cls(None, f"{type(error).__name__}: {error}"[:KEPT_CHARACTERS])


@dataclass(frozen=True)
class Channel:
    """A way that messages go.

    Attributes:
        name: as a delivery and a monitor's receivers keep it.
        check: refuses, by an `AddressError`, an address that is none, or that the operator does not
            allow.
        send: tries once to bring a message to its receiver; nothing is raised for one that fails.
        member: of a monitor, the list of addresses; None of a channel whose receivers are the
            project's.
        meaning: of that member, in words.
    """

    name: str
    check: Callable[[str, Settings], None]
    send: Callable[[Delivery, Receiver, Settings], Awaitable[Outcome]]
    member: str | None = None
    meaning: str = ""
