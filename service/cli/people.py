"""Commands on API keys and users."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import Data, settings_of_running, stop_with

if TYPE_CHECKING:
    from pathlib import Path

    from sqlalchemy.orm import Session

    from service.access import User

keys = typer.Typer(help="API keys.", no_args_is_help=True)
users = typer.Typer(help="Users.", no_args_is_help=True)


@contextmanager
def _transaction(data: Path | None) -> Iterator[Session]:
    """A transaction on the database that the settings mean, or that of the service which runs."""
    from service.db.engine import make_engine, make_sessions
    from service.db.opening import open_database
    from service.db.schema import require_head

    with open_database(settings_of_running(data)) as opened:
        engine = make_engine(opened.database_url or "")
        try:
            require_head(engine)
            with make_sessions(engine).begin() as session:
                yield session
        finally:
            engine.dispose()


def _name(text: str) -> str:
    """A name as REST takes it."""
    from pydantic import TypeAdapter, ValidationError

    from service.web.bodies import Name

    try:
        return TypeAdapter[str](Name).validate_python(text)
    except ValidationError as error:
        raise typer.BadParameter("; ".join(fault["msg"] for fault in error.errors())) from None


@keys.command("create")
def create(
    name: Annotated[str, typer.Option(help="Name of the user, who is made when absent", callback=_name)],
    scope: Annotated[list[str] | None, typer.Option(help="read, write, jobs, admin; all by default")] = None,
    days: Annotated[float | None, typer.Option(min=0.001, max=36500, help="Days after which it expires")] = None,
    data: Data = None,
) -> None:
    """Make an API key and print it, alone on standard output. Works while the service runs."""
    from datetime import UTC, datetime, timedelta

    from service.access import audit
    from service.access.keys import create_key, user_named
    from service.access.scopes import SCOPES

    scopes = list(dict.fromkeys(scope or SCOPES))
    if unknown := set(scopes) - set(SCOPES):
        stop_with(f"--scope {' '.join(sorted(unknown))}: there is {', '.join(SCOPES)}", 2)
    expires_at = None if days is None else datetime.now(UTC) + timedelta(days=days)
    with _transaction(data) as session:
        row, key = create_key(session, user_named(session, name), name, scopes, expires_at)
        audit(session, None, "api_key.create", "api_key", row.id, name=name, scopes=scopes)
    typer.echo(key)


@keys.command("list")
def list_keys(data: Data = None) -> None:
    """List all API keys, one a line: prefix, user, name, scopes, state."""
    from datetime import UTC, datetime

    from sqlalchemy import select

    from service.access import ApiKey, User

    with _transaction(data) as session:
        for key, user in session.execute(
            select(ApiKey, User).join(User, User.id == ApiKey.user_id).order_by(ApiKey.id)
        ):
            state = "valid"
            if key.expires_at is not None:
                state = (
                    f"{'expired' if key.expires_at <= datetime.now(UTC) else 'valid until'} {key.expires_at:%Y-%m-%d}"
                )
            if key.revoked_at is not None or user.disabled_at is not None:
                state = "revoked" if key.revoked_at is not None else "user disabled"
            typer.echo("\t".join((key.prefix, user.name, key.name, ",".join(key.scopes), state)))


@keys.command("revoke")
def revoke(prefix: Annotated[str, typer.Argument(help="As `keys list` shows it")], data: Data = None) -> None:
    """Revoke an API key: from now on it opens nothing."""
    from sqlalchemy import func, select

    from service.access import ApiKey, audit

    with _transaction(data) as session:
        key = session.scalars(select(ApiKey).where(ApiKey.prefix == prefix)).one_or_none()
        if key is None:
            stop_with(f"no key has the prefix {prefix}; `modalbase keys list` shows all")
        if key.revoked_at is None:
            key.revoked_at = func.now()
            audit(session, None, "api_key.revoke", "api_key", key.id)


@users.command("list")
def list_users(data: Data = None) -> None:
    """List all users, one a line: name, state, and `administrator` of who is one."""
    from sqlalchemy import select

    from service.access import User

    with _transaction(data) as session:
        for user in session.scalars(select(User).order_by(User.name)):
            words = [user.name, "enabled" if user.disabled_at is None else "disabled"]
            typer.echo("\t".join([*words, "administrator"] if user.administrator else words))


@users.command("disable")
def disable(name: str, data: Data = None) -> None:
    """Disable a user: their keys open nothing until they are enabled again."""
    _set_disabled(name, data, disabled=True)


@users.command("enable")
def enable(name: str, data: Data = None) -> None:
    """Enable a user who was disabled."""
    _set_disabled(name, data, disabled=False)


@users.command("promote")
def promote(name: str, data: Data = None) -> None:
    """Make a user an administrator, who may list users and disable them and end their keys by REST."""
    _set_administrator(name, data, administrator=True)


@users.command("demote")
def demote(name: str, data: Data = None) -> None:
    """Take an administrator's right to look after other users away."""
    _set_administrator(name, data, administrator=False)


def _set_administrator(name: str, data: Path | None, *, administrator: bool) -> None:
    from service.access import audit

    with _transaction(data) as session:
        user = _user(session, name)
        user.administrator = administrator
        audit(session, None, "user.promote" if administrator else "user.demote", "user", user.id)


def _set_disabled(name: str, data: Path | None, *, disabled: bool) -> None:
    from sqlalchemy import func

    from service.access import audit

    with _transaction(data) as session:
        user = _user(session, name)
        user.disabled_at = func.now() if disabled else None
        audit(session, None, "user.disable" if disabled else "user.enable", "user", user.id)


def _user(session: Session, name: str) -> User:
    from sqlalchemy import select

    from service.access import User

    user = session.scalars(select(User).where(User.name == name)).one_or_none()
    if user is None:
        stop_with(f"there is no user {name!r}; `modalbase users list` shows all")
    return user
