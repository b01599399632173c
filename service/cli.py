"""The command `modalbase`."""

from __future__ import annotations

import errno
import gc
import os
import signal
import socket
import sys
import threading
from pathlib import Path
from types import FrameType
from typing import Annotated, Any, NoReturn

import typer

from service.client.app import add_commands

# What a command needs is imported when it runs: a child of the worker imports this module too, and must start fast.

app = typer.Typer(
    name="modalbase",
    help="Structural test campaigns, and finite element models updated to them.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
db = typer.Typer(help="The database's schema.", no_args_is_help=True)
keys = typer.Typer(help="API keys.", no_args_is_help=True)
app.add_typer(db, name="db")
app.add_typer(keys, name="keys")
add_commands(app)

Data = Annotated[Path | None, typer.Option(help="Folder of the embedded database [MODALBASE_DATA]")]
Host = Annotated[str | None, typer.Option(help="Address to listen on [MODALBASE_HOST]")]
Port = Annotated[int | None, typer.Option(help="Port to listen on; 0: any free one [MODALBASE_PORT]")]
Attached = Annotated[bool, typer.Option("--attached", hidden=True, help="End when standard input closes")]


def main() -> None:
    """Run the command; what goes wrong on purpose is one line on standard error."""
    signal.signal(signal.SIGTERM, _leave)
    try:
        app()
    except Exception as error:
        if (told := _told(error)) is None:
            raise
        _stop_with(*told)


def _told(error: Exception) -> tuple[str, int] | None:
    """The line and the exit code of an error that is raised on purpose; None of any other."""
    from service.client.errors import ClientError

    if isinstance(error, ClientError):
        return str(error), error.code
    if isinstance(error, OSError) and error.errno == errno.ENOSPC:
        _forget_output()
        return f"cannot write{f' {error.filename}' if error.filename else ''}: no space left", 2

    from sqlalchemy.exc import OperationalError

    from service.db.engine import DatabaseUrlError
    from service.db.opening import DataFolderError
    from service.db.schema import SchemaError
    from service.problems.errors import ServiceError
    from service.supervisor import StartError

    if isinstance(error, DatabaseUrlError | DataFolderError | SchemaError | StartError | ServiceError):
        return str(error), 1
    if isinstance(error, OperationalError):
        return f"the database does not answer: {error.orig}", 1
    return None


def _stop_with(message: str, code: int = 1) -> NoReturn:
    typer.echo(f"modalbase: {message}", err=True)
    sys.exit(code)


def _forget_output() -> None:
    """What could not be written is not tried again when the interpreter ends, which would tell it a second time."""
    with open(os.devnull, "wb") as nothing:
        os.dup2(nothing.fileno(), sys.stdout.fileno())


def _leave(_signal: int, _frame: FrameType | None) -> NoReturn:
    """SIGTERM unwinds as an error does, so that everything opened is closed."""
    sys.exit(0)


def _settings(**given: Any) -> Any:
    """Settings of the environment, with what the command line says instead."""
    from pydantic import ValidationError

    from service.settings import Settings

    try:
        return Settings(**{name: value for name, value in given.items() if value is not None})
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}" for fault in error.errors())
        _stop_with(f"settings: {faults}")


def _version(wanted: bool) -> None:
    if wanted:
        from fecore import __version__

        typer.echo(f"modalbase {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    _: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version")] = False,
) -> None:
    """Structural test campaigns, and finite element models updated to them."""


@app.command()
def up(port: Port = None, data: Data = None, host: Host = None) -> None:
    """Run everything on this machine: PostgreSQL, the API, one worker. Ctrl-C ends it."""
    from fecore import __version__
    from service.supervisor import LocalService, StartError

    settings = _settings(port=port, data=data, host=host)
    end = threading.Event()
    with LocalService(settings) as service:
        for name in (signal.SIGINT, signal.SIGTERM):  # until here they break off the start
            signal.signal(name, lambda *_: end.set())
        typer.echo(f"modalbase {__version__}")
        typer.echo(f"  API            {service.url}/api/v1")
        typer.echo(f"  documentation  {service.url}/docs")
        typer.echo(f"  database       {'MODALBASE_DATABASE_URL' if settings.database_url else settings.data}")
        if not service.has_keys():
            typer.echo(f"  API key        {service.new_key('operator')}  (shown this once)")
        typer.echo("Ctrl-C ends it.")
        while not end.wait(0.2):
            if gone := service.ended():
                raise StartError(f"the {gone} ended unexpectedly; its log above says why")
            if service.keep_database():
                typer.echo("PostgreSQL had died; it runs again", err=True)
    typer.echo("ended")


@app.command()
def demo(
    as_json: Annotated[bool, typer.Option("--json", help="Print the result document alone on standard output")] = False,
    keep: Annotated[bool, typer.Option("--keep", help="Leave the service up to look around; Ctrl-C ends it")] = False,
) -> None:
    """Update the paper's beam, from an empty database to parameters and metrics, through REST alone."""
    from service.demo.laboratory import DemoError
    from service.demo.run import run_demo

    try:
        run_demo(as_json=as_json, keep=keep)
    except DemoError as error:
        _stop_with(str(error))


@app.command()
def serve(
    port: Port = None,
    data: Data = None,
    host: Host = None,
    attached: Attached = False,
    listener: Annotated[int | None, typer.Option(hidden=True, help="Descriptor of a socket that listens")] = None,
) -> None:
    """Run the API alone."""
    import uvicorn

    from service.app import create_app
    from service.db.opening import open_database
    from service.logs import configure_logs
    from service.supervisor import listening_socket

    settings = _settings(port=port, data=data, host=host)
    configure_logs(settings)
    _end_with_stdin(attached)
    own = listening_socket(settings.host, settings.port) if listener is None else socket.socket(fileno=listener)
    with own, open_database(settings) as opened:
        api = create_app(opened)
        _spare_what_is_loaded()
        config = uvicorn.Config(
            api, log_config=None, access_log=False, timeout_graceful_shutdown=10, server_header=False
        )

        class Server(uvicorn.Server):
            """Ends streams of events, which would go on, before it waits for requests to end."""

            def handle_exit(self, sig: int, frame: FrameType | None) -> None:
                api.state.changes.close()
                super().handle_exit(sig, frame)

        Server(config).run(sockets=[own])


@app.command()
def worker(
    data: Data = None,
    concurrency: Annotated[int | None, typer.Option(help="Jobs at a time [MODALBASE_WORKER_CONCURRENCY]")] = None,
    threads: Annotated[
        int | None, typer.Option(help="Threads of a job's linear algebra [MODALBASE_JOB_THREADS]")
    ] = None,
    queues: Annotated[str | None, typer.Option(help="Queues to serve, separated by commas; all by default")] = None,
    attached: Attached = False,
) -> None:
    """Run a worker. Any number may run, on any machine that reaches the database."""
    from service.composition import KINDS
    from service.db.opening import open_database
    from service.jobs.worker import run_worker
    from service.logs import configure_logs
    from service.monitoring.steward import steward

    settings = _settings(data=data, worker_concurrency=concurrency, job_threads=threads)
    known, wanted = {kind.queue for kind in KINDS}, queues.split(",") if queues else None
    if wanted is not None and not known.issuperset(wanted):  # it would wait for ever
        _stop_with(f"--queues {queues}: there is {', '.join(sorted(known))}, separated by commas where several", 2)
    configure_logs(settings)
    _end_with_stdin(attached)
    _spare_what_is_loaded()
    with open_database(settings) as opened, steward(opened):
        run_worker(opened, KINDS, wanted)


@db.command("upgrade")
def db_upgrade(data: Data = None) -> None:
    """Bring the database's schema to this version's."""
    from service.db.engine import make_engine
    from service.db.opening import open_database
    from service.db.schema import current_revision, upgrade

    with open_database(_settings(data=data)) as opened:
        engine = make_engine(opened.database_url or "")
        upgrade(engine)
        typer.echo(f"the schema is at {current_revision(engine)}")
        engine.dispose()


@db.command("current")
def db_current(data: Data = None) -> None:
    """Print the revision that the database is at; exit 1 where it is not this version's."""
    from service.db.engine import make_engine
    from service.db.opening import open_database
    from service.db.schema import current_revision, require_head

    with open_database(_settings(data=data)) as opened:
        engine = make_engine(opened.database_url or "")
        typer.echo(current_revision(engine) or "empty")
        try:
            require_head(engine)
        finally:
            engine.dispose()


def _name(text: str) -> str:
    """A name as REST takes it."""
    from pydantic import TypeAdapter, ValidationError

    from service.problems.schema import Name

    try:
        return TypeAdapter[str](Name).validate_python(text)
    except ValidationError as error:
        raise typer.BadParameter("; ".join(fault["msg"] for fault in error.errors())) from None


@keys.command("create")
def keys_create(
    name: Annotated[str, typer.Option(help="Name of the user, who is made when absent", callback=_name)],
    data: Data = None,
) -> None:
    """Make an API key and print it, alone on standard output. Works while the service runs."""
    from service.access import audit
    from service.access.keys import create_key, user_named
    from service.db.engine import make_engine, make_sessions
    from service.db.opening import open_database
    from service.db.schema import require_head

    with open_database(_settings(data=data)) as opened:
        engine = make_engine(opened.database_url or "")
        try:
            require_head(engine)
            with make_sessions(engine).begin() as session:
                row, key = create_key(session, user_named(session, name), name)
                audit(session, None, "api_key.create", "api_key", row.id, name=name)
        finally:
            engine.dispose()
    typer.echo(key)


def _spare_what_is_loaded() -> None:
    """Keep the garbage collector from what is loaded and stays: looking through it holds everybody up, for 0.1 s at a time."""
    gc.collect()
    gc.freeze()


def _end_with_stdin(attached: bool) -> None:
    """Where another process started this one, end when that one is gone: the pipe to standard input closes."""
    if not attached:
        return

    def watch() -> None:
        while os.read(0, 4096):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, daemon=True, name="lifeline").start()
