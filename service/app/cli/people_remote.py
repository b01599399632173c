"""`modalbase keys` and `users` at a service that runs elsewhere, over REST."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modalbase.client.errors import ClientError

if TYPE_CHECKING:
    from modalbase.client.connection import Connection

FORBIDDEN = 403

Remote = Annotated[
    bool,
    typer.Option("--remote", help="Ask the service of MODALBASE_URL or of the saved profile, not the database here"),
]
Url = Annotated[str | None, typer.Option("--url", help="Ask the service at this address, not the database here")]


def remote_service(remote: bool, url: str | None) -> Connection | None:
    """The service that a command is for; None where it works on the database here.

    Raises:
        ClientError: no service or no key is found.
    """
    if not (remote or url):
        return None
    from modalbase.client.options import service_at

    return service_at(url)


def new_key(service: Connection, name: str, scopes: list[str] | None, expires_at: datetime | None) -> str:
    """Another key of the user whose key the connection has."""
    body: dict[str, Any] = {"name": name}
    if scopes:
        body["scopes"] = scopes
    if expires_at is not None:
        body["expires_at"] = expires_at.isoformat()
    return str(service.post("api-keys", body)["key"])


def keys_of_all(service: Connection) -> Iterator[tuple[dict[str, Any], dict[str, Any] | None]]:
    """Every key with its user, for an administrator; one's own, without one, for anybody else."""
    try:
        users = list(service.pages("users"))
    except ClientError as error:
        if error.status != FORBIDDEN:
            raise
        yield from ((key, None) for key in service.pages("api-keys"))
        return
    for user in users:
        yield from ((key, user) for key in service.pages(f"users/{user['id']}/api-keys"))


def revoke(service: Connection, prefix: str) -> None:
    """Revoke the key of a prefix.

    Raises:
        ClientError: one sees no such key.
    """
    for key, user in keys_of_all(service):
        if key["prefix"] == prefix:
            service.call("DELETE", f"users/{user['id']}/api-keys/{key['id']}" if user else f"api-keys/{key['id']}")
            return
    raise ClientError(f"no key that one may see has the prefix {prefix}; `modalbase keys list` shows all")


def set_disabled(service: Connection, name: str, *, disabled: bool) -> None:
    """Disable a user, or enable one again.

    Raises:
        ClientError: there is no such user, or the key is no administrator's.
    """
    found = list(service.pages("users", name=name))
    if not found:
        raise ClientError(f"there is no user {name!r}; `modalbase users list` shows all")
    service.call("POST", f"users/{found[0]['id']}/{'disable' if disabled else 'enable'}")
