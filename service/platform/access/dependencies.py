"""What a route asks for: the transaction, the user, the settings.

Those that wait for nothing are coroutines: the framework sends any other through a thread, and each
way there and back costs a turn of the interpreter's lock while other requests compute.
"""

from collections.abc import AsyncIterator, Callable
from typing import Annotated, TypeVar

from anyio import CancelScope
from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool

from service.platform.access.keys import authenticated_key, require_scope
from service.platform.access.tables import ApiKey, User
from service.platform.settings import Settings

Result = TypeVar("Result")

READING = ("GET", "HEAD")
"""Methods of routes that change nothing."""


async def _settings(request: Request) -> Settings:
    settings: Settings = request.app.state.settings
    return settings


async def _session(request: Request) -> AsyncIterator[Session]:
    """One transaction a request: committed before the answer is sent, rolled back on any error.

    To begin one asks the database nothing; to end it does, and happens in a thread whatever becomes
    of the request. A request that only reads has nothing to end.
    """
    if request.method in READING:
        with request.app.state.reading() as session:
            yield session
        return
    transaction = request.app.state.sessions.begin()
    session = transaction.__enter__()
    try:
        yield session
    except BaseException as error:
        with CancelScope(shield=True):
            await run_in_threadpool(transaction.__exit__, type(error), error, error.__traceback__)
        raise
    await run_in_threadpool(transaction.__exit__, None, None, None)


SettingsDep = Annotated[Settings, Depends(_settings)]
SessionDep = Annotated[Session, Depends(_session, scope="function")]

_bearer = HTTPBearer(description="an API key: `modalbase keys create --name NAME`")


def _current_key(
    request: Request,
    session: SessionDep,
    credentials: Annotated[HTTPAuthorizationCredentials, Depends(_bearer)],
) -> tuple[ApiKey, User]:
    key, user = authenticated_key(session, credentials.credentials)
    require_scope(key, request.scope)
    return key, user


async def _key(authenticated: Annotated[tuple[ApiKey, User], Depends(_current_key)]) -> ApiKey:
    return authenticated[0]


async def _user(authenticated: Annotated[tuple[ApiKey, User], Depends(_current_key)]) -> User:
    return authenticated[1]


class Beforehand:
    """What a request does in a transaction of its own before its route:
    `beforehand: Annotated[Beforehand, Depends()]`.
    """

    def __init__(
        self,
        request: Request,
        credentials: Annotated[HTTPAuthorizationCredentials, Depends(_bearer)],
    ) -> None:
        self._request, self._token = request, credentials.credentials

    async def do(self, work: Callable[[Session, ApiKey, User], Result]) -> Result:
        """What `work` gives for the key of the request and its user, once that is committed.

        Raises:
            Unauthorized, Forbidden: the key is not valid or has not the scope.
        """
        return await run_in_threadpool(self._do, work)

    def _do(self, work: Callable[[Session, ApiKey, User], Result]) -> Result:
        with self._request.app.state.sessions.begin() as session:
            key, user = authenticated_key(session, self._token)
            require_scope(key, self._request.scope)
            return work(session, key, user)


CurrentKey = Annotated[ApiKey, Depends(_key)]
CurrentUser = Annotated[User, Depends(_user)]


def token_of(request: Request) -> str:
    """The API key or session token of a request that was let in; a session's cookie comes as its
    token.
    """
    return request.headers["authorization"].partition(" ")[2].strip()
