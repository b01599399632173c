"""What one API process remembers of keys, so that who is turned away costs neither a transaction nor a slot.

A key that was found valid a moment ago is counted under its own name at the gate, any other under the address that it came
from. Nothing is let in by memory alone: the transaction that answers a request asks for the key again.
"""

from __future__ import annotations

import hashlib
import time
from collections import OrderedDict
from dataclasses import dataclass

from service.errors import TooManyRequests, Unauthorized
from service.web.buckets import Buckets

SECONDS = 30.0  # for which a verdict is remembered
MOST_KEYS = 10_000
MISSING = "send `Authorization: Bearer KEY`; make a key with `modalbase keys create --name NAME`"
INVALID = "the API key is not valid; make one with `modalbase keys create --name NAME`"


@dataclass(frozen=True)
class Caller:
    """Who asks, as far as is known before the database was asked.

    Attributes:
        name: under which requests are counted: the key where it was valid a moment ago, else the address.
        digest: of the key.
        token: the key.
        known: the key was valid a moment ago.
    """

    name: str
    digest: bytes
    token: str
    known: bool


class KnownKeys:
    """Verdicts on keys, and the number of wrong keys that each address has tried."""

    def __init__(self, failures_a_minute: int) -> None:
        self._verdicts: OrderedDict[bytes, tuple[bool, float]] = OrderedDict()
        self._failures = Buckets(failures_a_minute, 60.0)

    def caller(self, authorization: str | None, address: str) -> Caller:
        """Who asks.

        Raises:
            Unauthorized: there is no key, or it was wrong a moment ago.
            TooManyRequests: the address has tried too many wrong keys, and this one is not known to be right.
        """
        scheme, _, token = (authorization or "").partition(" ")
        token = token.strip()
        if scheme.lower() != "bearer" or not token:
            raise Unauthorized(MISSING)
        digest = hashlib.sha256(token.encode("utf-8", "surrogatepass")).digest()
        verdict = self._verdict(digest)
        if verdict is False:
            raise Unauthorized(INVALID)
        if verdict is None and self._failures.left(address) < 1:
            raise TooManyRequests("too many wrong keys came from this address; wait a minute", retry_after=60)
        known = verdict is True
        return Caller(f"key {digest.hex()}" if known else f"address {address}", digest, token, known)

    def found(self, caller: Caller, address: str, *, valid: bool) -> None:
        """The database was asked."""
        if not valid and self._verdict(caller.digest) is not False:
            self._failures.take(address)
        self._verdicts[caller.digest] = valid, time.monotonic() + SECONDS
        self._verdicts.move_to_end(caller.digest)
        if len(self._verdicts) > MOST_KEYS:
            self._verdicts.popitem(last=False)

    def _verdict(self, digest: bytes) -> bool | None:
        valid, until = self._verdicts.get(digest, (None, 0.0))
        return valid if time.monotonic() < until else None
