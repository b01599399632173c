"""Commands that run a service: the whole on one machine, or a part."""

from __future__ import annotations

import gc
import os
import signal
import socket
import threading
from contextlib import contextmanager
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import Attached, Data, Host, Port, settings_of, stop_with

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from service.supervisor import LocalService

commands = typer.Typer()


@commands.command()
def up(port: Port = None, data: Data = None, host: Host = None) -> None:
    """Run everything on this machine: PostgreSQL, the API, one worker. Ctrl-C ends it."""
    with _loading():
        from service.running import announced
        from service.supervisor import LocalService

    settings = settings_of(port=port, data=data, host=host)
    if "access_log" not in settings.model_fields_set:
        settings = settings.model_copy(update={"access_log": False})  # one reads along here
    end = threading.Event()
    with LocalService(settings) as service:
        for name in (signal.SIGINT, signal.SIGTERM):  # until here they break off the start
            signal.signal(name, lambda *_: end.set())
        embedded = None if settings.database_url else settings.data.expanduser().resolve()
        with announced(service.url, embedded):
            _welcome(service, embedded)
            while not end.wait(0.2):
                for line in service.tend():
                    typer.echo(f"modalbase: {line}", err=True)
    typer.echo("ended")


def _welcome(service: LocalService, embedded: Path | None) -> None:
    """A line for each thing that is ready, and last how to get in."""
    from fecore import __version__
    from modalbase.client.place import KEY_FILE, write_private

    typer.echo(f"modalbase {__version__}")
    jobs = service.settings.worker_concurrency
    typer.echo(f"  database       ready   {embedded or 'the server of MODALBASE_DATABASE_URL'}")
    typer.echo(f"  worker         ready   {jobs} job{'s' if jobs > 1 else ''} at a time")
    typer.echo(f"  API            ready   {service.url}/api/v1")
    if service.settings.pages:
        typer.echo(f"  pages          ready   {service.url}/ui/  (sign in with the key)")
    if service.settings.docs:
        typer.echo(f"  guide          ready   {service.url}/guide/")
        typer.echo(f"  documentation  ready   {service.url}/docs")
    typer.echo("Ctrl-C ends it.")
    if service.has_keys():
        typer.echo("API key: those made before still work; one more: modalbase keys create --name NAME")
    else:
        key = service.new_key("operator", administrator=True)
        if embedded is not None:  # who reads this folder has the database anyway
            write_private(embedded / KEY_FILE, key + "\n")
        typer.echo(f"API key: {key}  (shown this once; one more: modalbase keys create --name NAME)")


@commands.command()
def demo(
    as_json: Annotated[bool, typer.Option("--json", help="Print the result document alone on standard output")] = False,
    keep: Annotated[bool, typer.Option("--keep", help="Leave the service up to look around; Ctrl-C ends it")] = False,
) -> None:
    """Update the paper's beam, from an empty database to parameters and metrics, through REST alone."""
    from service.demo.run import run_demo

    run_demo(as_json=as_json, keep=keep)


@commands.command()
def serve(
    port: Port = None,
    data: Data = None,
    host: Host = None,
    attached: Attached = False,
    listener: Annotated[int | None, typer.Option(hidden=True, help="Descriptor of a socket that listens")] = None,
) -> None:
    """Run the API alone."""
    with _loading():
        import uvicorn

        from service.app import create_app
        from service.db.opening import open_database
        from service.logs import configure_logs
        from service.supervisor import listening_socket
        from service.web.server import PatientProtocol

    settings = settings_of(port=port, data=data, host=host)
    configure_logs(settings)
    _follow(attached)
    own = listening_socket(settings.host, settings.port) if listener is None else socket.socket(fileno=listener)
    with own, open_database(settings) as opened:
        api = create_app(opened)
        config = uvicorn.Config(
            api,
            http=PatientProtocol,
            log_config=None,
            access_log=False,
            timeout_graceful_shutdown=10,
            server_header=False,
        )

        class Server(uvicorn.Server):
            """Ends streams of events, which would go on, before it waits for requests to end."""

            def handle_exit(self, sig: int, frame: FrameType | None) -> None:
                api.state.changes.close()
                super().handle_exit(sig, frame)

        Server(config).run(sockets=[own])


@commands.command()
def worker(
    data: Data = None,
    concurrency: Annotated[int | None, typer.Option(help="Jobs at a time [MODALBASE_WORKER_CONCURRENCY]")] = None,
    threads: Annotated[
        int | None, typer.Option(help="Threads of a job's linear algebra [MODALBASE_JOB_THREADS]")
    ] = None,
    queues: Annotated[str | None, typer.Option(help="Queues to serve, separated by commas; all by default")] = None,
    attached: Attached = False,
    ready: Annotated[int | None, typer.Option(hidden=True, help="Descriptor to write to when it takes jobs")] = None,
) -> None:
    """Run a worker. Any number may run, on any machine that reaches the database."""
    with _loading():
        from service.db.opening import open_database
        from service.jobs.worker import run_worker
        from service.kinds import KINDS
        from service.logs import configure_logs
        from service.monitoring.scheduler import scheduler

    settings = settings_of(data=data, worker_concurrency=concurrency, job_threads=threads)
    known, wanted = {kind.queue for kind in KINDS}, queues.split(",") if queues else None
    if wanted is not None and not known.issuperset(wanted):  # it would wait for ever
        stop_with(f"--queues {queues}: there is {', '.join(sorted(known))}, separated by commas where several", 2)
    configure_logs(settings)
    _follow(attached)
    with open_database(settings) as opened, scheduler(opened):
        run_worker(opened, KINDS, wanted, partial(_report_ready, ready))


def _report_ready(ready: int | None) -> None:
    """Let who started this worker know that it takes jobs."""
    if ready is not None:
        os.write(ready, b"1")


@contextmanager
def _loading() -> Iterator[None]:
    """Keep the garbage collector from what is being loaded, now and later: one object in a hundred of it is garbage, and to
    look through it takes 0.1 s at a time, in which everybody waits.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def _follow(attached: bool) -> None:
    """Where another process started this one, go on when that one has opened the database, which it says by a byte on
    standard input, and end when it is gone: the pipe closes.
    """
    if not attached:
        return
    if not os.read(0, 1):
        raise typer.Exit

    def watch() -> None:
        while os.read(0, 4096):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, daemon=True, name="lifeline").start()
