"""Commands on API keys and users: on the database of the service that runs here, or at one
elsewhere over REST.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Annotated

import typer

from service.app.cli.ending import stop_with
from service.app.cli.options import Data, settings_of_running

if TYPE_CHECKING:
    from pathlib import Path

    from sqlalchemy.orm import Session

    from modalbase.objects.laboratory import Laboratory
    from service.platform.access import User

Remote = Annotated[
    bool,
    typer.Option(
        "--remote",
        help="Ask the service of MODALBASE_URL or of the saved profile, not the database here",
    ),
]
Url = Annotated[
    str | None, typer.Option("--url", help="Ask the service at this address, not the database here")
]


def remote_laboratory(remote: bool, url: str | None) -> Laboratory | None:
    """The laboratory that a command is for; None where it works on the database here.

    Raises:
        ClientError: no service or no key is found.
    """
    if not (remote or url):
        return None
    from modalbase.commands.options import laboratory_at

    return laboratory_at(url)


keys = typer.Typer(help="API keys.", no_args_is_help=True)
users = typer.Typer(help="Users.", no_args_is_help=True)


@contextmanager
def _transaction(data: Path | None) -> Iterator[Session]:
    """A transaction on the database that the settings mean, or that of the service which runs."""
    from service.platform.db.engine import make_sessions
    from service.platform.db.opening import opened_engine
    from service.platform.db.schema import require_head

    with opened_engine(settings_of_running(data)) as engine:
        require_head(engine)
        with make_sessions(engine).begin() as session:
            yield session


def _name(text: str) -> str:
    """A name as REST takes it."""
    from pydantic import TypeAdapter, ValidationError

    from service.platform.web.bodies import Name

    try:
        return TypeAdapter[str](Name).validate_python(text)
    except ValidationError as error:
        raise typer.BadParameter("; ".join(fault["msg"] for fault in error.errors())) from None


@keys.command("create")
def create(
    name: Annotated[
        str,
        typer.Option(
            help=(
                "Name of the user, who is made when absent; elsewhere, of another key of one's own"
            ),
            callback=_name,
        ),
    ],
    scope: Annotated[
        list[str] | None, typer.Option(help="read, write, jobs, admin; all by default")
    ] = None,
    days: Annotated[
        float | None, typer.Option(min=0.001, max=36500, help="Days after which it expires")
    ] = None,
    data: Data = None,
    remote: Remote = False,
    url: Url = None,
) -> None:
    """Make an API key and print it, alone on standard output. Works while the service runs."""
    from service.platform.access import audit
    from service.platform.access.keys import SCOPES, create_key, user_named

    scopes = list(dict.fromkeys(scope or SCOPES))
    if unknown := set(scopes) - set(SCOPES):
        stop_with(f"--scope {' '.join(sorted(unknown))}: there is {', '.join(SCOPES)}", 2)
    expires_at = None if days is None else datetime.now(UTC) + timedelta(days=days)
    if (lab := remote_laboratory(remote, url)) is not None:
        with lab:
            typer.echo(lab.new_api_key(name, scope or (), expires_at))
        return
    with _transaction(data) as session:
        row, key = create_key(session, user_named(session, name), name, scopes, expires_at)
        audit(session, None, "api_key.create", "api_key", row.id, name=name, scopes=scopes)
    typer.echo(key)


@keys.command("list")
def list_keys(data: Data = None, remote: Remote = False, url: Url = None) -> None:
    """List all API keys, one a line: prefix, user, name, scopes, state. Elsewhere one's own, of who
    is no administrator.
    """
    from sqlalchemy import select

    from service.platform.access import ApiKey, User

    if (lab := remote_laboratory(remote, url)) is not None:
        with lab:
            for one, owner in lab.api_keys():
                ends, disabled = (
                    one["expires_at"],
                    owner is not None and owner["disabled_at"] is not None,
                )
                state = _state(
                    one["revoked_at"], disabled, datetime.fromisoformat(ends) if ends else None
                )
                _say(
                    one["prefix"],
                    "-" if owner is None else owner["name"],
                    one["name"],
                    ",".join(one["scopes"]),
                    state,
                )
        return
    with _transaction(data) as session:
        for key, user in session.execute(
            select(ApiKey, User).join(User, User.id == ApiKey.user_id).order_by(ApiKey.id)
        ):
            state = _state(key.revoked_at, user.disabled_at is not None, key.expires_at)
            _say(key.prefix, user.name, key.name, ",".join(key.scopes), state)


def _state(revoked_at: object, disabled: bool, expires_at: datetime | None) -> str:
    if revoked_at is not None or disabled:
        return "revoked" if revoked_at is not None else "user disabled"
    if expires_at is None:
        return "valid"
    return (
        f"{'expired' if expires_at <= datetime.now(UTC) else 'valid until'} {expires_at:%Y-%m-%d}"
    )


def _say(*words: str) -> None:
    typer.echo("\t".join(words))


@keys.command("revoke")
def revoke(
    prefix: Annotated[str, typer.Argument(help="As `keys list` shows it")],
    data: Data = None,
    remote: Remote = False,
    url: Url = None,
) -> None:
    """Revoke an API key: from now on it opens nothing."""
    from sqlalchemy import func, select

    from service.platform.access import ApiKey, audit

    if (lab := remote_laboratory(remote, url)) is not None:
        with lab:
            lab.revoke_api_key(prefix)
        return
    with _transaction(data) as session:
        key = session.scalars(select(ApiKey).where(ApiKey.prefix == prefix)).one_or_none()
        if key is None:
            stop_with(f"no key has the prefix {prefix}; `modalbase keys list` shows all")
        if key.revoked_at is None:
            key.revoked_at = func.now()
            audit(session, None, "api_key.revoke", "api_key", key.id)


@users.command("list")
def list_users(data: Data = None, remote: Remote = False, url: Url = None) -> None:
    """List all users, one a line: name, state, and `administrator` of who is one. Elsewhere for
    administrators.
    """
    from sqlalchemy import select

    from service.platform.access import User

    if (lab := remote_laboratory(remote, url)) is not None:
        with lab:
            for one in sorted(lab.users(), key=lambda user: str(user["name"])):
                _say_user(one["name"], one["disabled_at"], one["administrator"])
        return
    with _transaction(data) as session:
        for user in session.scalars(select(User).order_by(User.name)):
            _say_user(user.name, user.disabled_at, user.administrator)


def _say_user(name: str, disabled_at: object, administrator: bool) -> None:
    state = "enabled" if disabled_at is None else "disabled"
    _say(name, state, *(["administrator"] if administrator else []))


@users.command("disable")
def disable(name: str, data: Data = None, remote: Remote = False, url: Url = None) -> None:
    """Disable a user: their keys open nothing until they are enabled again."""
    _set_disabled(name, data, remote_laboratory(remote, url), disabled=True)


@users.command("enable")
def enable(name: str, data: Data = None, remote: Remote = False, url: Url = None) -> None:
    """Enable a user who was disabled."""
    _set_disabled(name, data, remote_laboratory(remote, url), disabled=False)


@users.command("promote")
def promote(name: str, data: Data = None) -> None:
    """Make a user an administrator, who may list users and disable them and end their keys by
    REST.
    """
    _set_administrator(name, data, administrator=True)


@users.command("demote")
def demote(name: str, data: Data = None) -> None:
    """Take an administrator's right to look after other users away."""
    _set_administrator(name, data, administrator=False)


def _set_administrator(name: str, data: Path | None, *, administrator: bool) -> None:
    from service.platform.access import audit

    with _transaction(data) as session:
        user = _user(session, name)
        user.administrator = administrator
        audit(session, None, "user.promote" if administrator else "user.demote", "user", user.id)


def _set_disabled(name: str, data: Path | None, lab: Laboratory | None, *, disabled: bool) -> None:
    from sqlalchemy import func

    from service.platform.access import audit

    if lab is not None:
        with lab:
            lab.set_disabled(name, disabled)
        return
    with _transaction(data) as session:
        user = _user(session, name)
        user.disabled_at = func.now() if disabled else None
        audit(session, None, "user.disable" if disabled else "user.enable", "user", user.id)


def _user(session: Session, name: str) -> User:
    from sqlalchemy import select

    from service.platform.access import User

    user = session.scalars(select(User).where(User.name == name)).one_or_none()
    if user is None:
        stop_with(f"there is no user {name!r}; `modalbase users list` shows all")
    return user
