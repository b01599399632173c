"""What a route asks for: the transaction, the user, the settings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from sqlalchemy.orm import Session

from service.access.keys import found_key
from service.access.scopes import require_scope
from service.access.tables import ApiKey, User
from service.errors import Unauthorized
from service.settings import Settings


def _settings(request: Request) -> Settings:
    settings: Settings = request.app.state.settings
    return settings


def _session(request: Request) -> Iterator[Session]:
    """One transaction a request: committed before the answer is sent, rolled back on any error."""
    with request.app.state.sessions.begin() as session:
        yield session


SettingsDep = Annotated[Settings, Depends(_settings)]
SessionDep = Annotated[Session, Depends(_session, scope="function")]

_bearer = HTTPBearer(auto_error=False, description="an API key: `modalbase keys create --name NAME`")


def _current_key(
    request: Request,
    session: SessionDep,
    credentials: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)],
) -> tuple[ApiKey, User]:
    if credentials is None:
        raise Unauthorized("send `Authorization: Bearer KEY`; make a key with `modalbase keys create --name NAME`")
    key, user = found_key(session, credentials.credentials)
    require_scope(key, request.scope)
    return key, user


def _key(found: Annotated[tuple[ApiKey, User], Depends(_current_key)]) -> ApiKey:
    return found[0]


def _user(found: Annotated[tuple[ApiKey, User], Depends(_current_key)]) -> User:
    return found[1]


CurrentKey = Annotated[ApiKey, Depends(_key)]
CurrentUser = Annotated[User, Depends(_user)]
