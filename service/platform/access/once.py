"""`Idempotency-Key`: what is sent again under a key is answered again, and makes nothing twice.

One row a user, operation and key holds the SHA-256 of the request and its answer, in the
transaction of what the request
made: after a rollback there is neither. `answered_once` gives an operation that creates the header
and this behaviour; the routers of `api_router` apply it to all of them. An answer that shows a
secret (`Cache-Control: no-store`) is kept sealed with the API key of its request, which is stored
nowhere, so that it opens to that key alone.
"""

import hashlib
import hmac
import inspect
import json
import secrets
from collections.abc import Callable, Mapping
from functools import partial, wraps
from typing import Annotated, Any
from uuid import UUID

from fastapi import Depends, Header, Request, Response
from pydantic import BaseModel
from sqlalchemy.orm import Session

from service.platform.access.dependencies import CurrentUser, SessionDep, token_of
from service.platform.access.tables import IdempotencyKey, User
from service.platform.db.base import Base, one_at_a_time
from service.platform.errors import Conflict, Invalid
from service.platform.settings import Settings
from service.platform.web.routing import AFTERWARDS

KeyHeader = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=255,
        description=(
            "any string of yours: the same request with it again makes nothing new and gets the"
            " same answer"
        ),
    ),
]
_MANNER = ("confirm", "priority")
"""Parameters that say how a request is done and not what it makes."""
_BESIDE = (Session, Base, Request, Response, Settings)
"""What an operation is given beside what the request states; what it states has `stated`, where it
is no JSON.
"""
_NONCE = 16  # bytes


def made_before(
    session: Session, user: User, operation: str, key: str, sha256: bytes
) -> IdempotencyKey | None:
    """What came with the key before; other transactions with this key wait until this one ends.

    Args:
        session: the transaction of what is to be made.
        user: who asks; each has keys of their own.
        operation: what is asked for; a key counts within one.
        key: the header.
        sha256: of the request.

    Raises:
        Invalid: the key came with another request.
    """
    one_at_a_time(session, f"{user.id} {operation} {key}")
    row = session.get(IdempotencyKey, (user.id, operation, key))
    if row is not None and row.request_sha256 not in (None, sha256):
        raise Invalid(
            "Idempotency-Key", "was used for another request; use a new key for a new one"
        )
    return row


def digest_of(request: Mapping[str, Any]) -> bytes:
    """SHA-256 of what a request states. Of a model only what differs from its defaults counts, of a
    file its SHA-256.
    """
    stated = {name: _stated(value) for name, value in request.items()}
    text = json.dumps(
        {name: value for name, value in stated.items() if value is not None}, sort_keys=True
    )
    return hashlib.sha256(text.encode()).digest()


def _stated(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", exclude_defaults=True)
    if isinstance(value, list):
        return [_stated(one) for one in value]
    if isinstance(value, UUID):
        return str(value)
    if value is None or isinstance(value, str | int | float | dict):
        return value
    return None if isinstance(value, _BESIDE) else value.stated


class Once:
    """The key of a request, and what it is for."""

    def __init__(self, request: Request, session: Session, user: User, key: str) -> None:
        self._scope, self._session, self._user, self._key = request.scope, session, user, key
        self._operation = str(request.scope["route"].label)
        # so that 202 says that nothing is made yet
        self._later = request.scope["route"].status_code == 201
        self._token = token_of(request).encode("utf-8", "surrogatepass")

    def answer(self, given: Mapping[str, Any]) -> Response | None:
        """The answer to the same request before; None to a new one, whose answer will be kept.

        Raises:
            Invalid: the key came with another request.
            Conflict: the answer has a secret, and was given to another API key.
        """
        sha256 = digest_of({name: value for name, value in given.items() if name not in _MANNER})
        row = made_before(self._session, self._user, self._operation, self._key, sha256)
        if row is None:
            self._scope[AFTERWARDS] = partial(self._keep, sha256)
            return None
        status, headers, body = json.loads(
            _opened(row.answer, self._token) if row.sealed else row.answer
        )
        response = Response(body, status)
        response.raw_headers = [
            (name.encode("latin-1"), value.encode("latin-1")) for name, value in headers
        ]
        return response

    def _keep(self, sha256: bytes, response: Response) -> None:
        """Keep an answer, in the transaction of what was made; that of a request which was refused
        is none.
        """
        if response.status_code >= 300 or (self._later and response.status_code == 202):
            return
        headers = [
            [name.decode("latin-1"), value.decode("latin-1")]
            for name, value in response.raw_headers
        ]
        answer = json.dumps([response.status_code, headers, bytes(response.body).decode()]).encode()
        sealed = response.headers.get("cache-control") == "no-store"
        keep(
            self._session,
            self._user,
            (self._operation, self._key),
            sha256,
            _sealed(answer, self._token) if sealed else answer,
            sealed=sealed,
        )


def keep(
    session: Session,
    user: User,
    name: tuple[str, str],
    sha256: bytes,
    answer: bytes,
    *,
    sealed: bool = False,
) -> None:
    """Keep the answer to a request under its operation and key, for `made_before`."""
    operation, key = name
    session.add(
        IdempotencyKey(
            user_id=user.id,
            operation=operation,
            key=key,
            request_sha256=sha256,
            answer=answer,
            sealed=sealed,
        )
    )
    session.flush()


def _sealed(answer: bytes, token: bytes) -> bytes:
    """An answer that only the token opens: a nonce, a mark by which the token is known, and the
    answer under a key stream.
    """
    nonce = secrets.token_bytes(_NONCE)
    return nonce + _mark(nonce, token) + _under_stream(answer, nonce, token)


def _opened(sealed: bytes, token: bytes) -> bytes:
    nonce, mark, hidden = sealed[:_NONCE], sealed[_NONCE : _NONCE + 32], sealed[_NONCE + 32 :]
    if not hmac.compare_digest(mark, _mark(nonce, token)):
        raise Conflict(
            "the Idempotency-Key was used with another API key, and the answer shows a secret to"
            " that one alone; use a new Idempotency-Key"
        )
    return _under_stream(hidden, nonce, token)


def _mark(nonce: bytes, token: bytes) -> bytes:
    return hmac.digest(token, b"mark" + nonce, "sha256")


def _under_stream(text: bytes, nonce: bytes, token: bytes) -> bytes:
    """SHAKE-256 of a secret of 256 bits and a nonce gives as many bytes as the text has, to be
    added to it.
    """
    stream = hashlib.shake_256(b"stream" + nonce + token).digest(len(text))
    return bytes(one ^ other for one, other in zip(text, stream, strict=True))


async def _once(
    request: Request, session: SessionDep, user: CurrentUser, idempotency_key: KeyHeader = None
) -> Once | None:
    return None if idempotency_key is None else Once(request, session, user, idempotency_key)


def answered_once(operation: Callable[..., Any]) -> Callable[..., Any]:
    """An operation that creates, with `Idempotency-Key`."""

    @wraps(operation)
    def answered(*, once: Once | None, **given: Any) -> Any:
        before = None if once is None else once.answer(given)
        return operation(**given) if before is None else before

    signature = inspect.signature(operation)
    key = inspect.Parameter(
        "once", inspect.Parameter.KEYWORD_ONLY, annotation=Annotated[Once | None, Depends(_once)]
    )
    answered.__signature__ = signature.replace(parameters=[*signature.parameters.values(), key])  # type: ignore[attr-defined]
    return answered
