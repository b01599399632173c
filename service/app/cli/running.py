"""Commands that run a service: the whole on one machine, or a part."""

from __future__ import annotations

import signal
import threading
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from service.app.cli.ending import stop_with
from service.app.cli.options import Data, Host, Port, settings_of

if TYPE_CHECKING:
    from pathlib import Path

    from service.app.supervisor import LocalService

commands = typer.Typer()


@commands.command()
def up(port: Port = None, data: Data = None, host: Host = None) -> None:
    """Run everything on this machine: PostgreSQL, the API, one worker. Ctrl-C ends it."""
    from service.app.running import announced
    from service.app.supervisor import LocalService

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
    from modalbase.client.endpoint import KEY_FILE, write_private

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
        typer.echo(
            "API key: those made before still work; one more: modalbase keys create --name NAME"
        )
    else:
        key = service.new_key("operator", administrator=True)
        if embedded is not None:  # who reads this folder has the database anyway
            write_private(embedded / KEY_FILE, key + "\n")
        typer.echo(
            f"API key: {key}  (shown this once; one more: modalbase keys create --name NAME)"
        )


@commands.command()
def demo(
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the result document alone on standard output")
    ] = False,
    keep: Annotated[
        bool, typer.Option("--keep", help="Leave the service up to look around; Ctrl-C ends it")
    ] = False,
) -> None:
    """Update the paper's beam, from an empty database to parameters and metrics, through REST
    alone.
    """
    from service.app.demo.run import run_demo

    run_demo(as_json=as_json, keep=keep)


@commands.command()
def serve(port: Port = None, data: Data = None, host: Host = None) -> None:
    """Run the API alone."""
    from service.app.serving import serve as run

    run(partial(settings_of, port=port, data=data, host=host))


@commands.command()
def worker(
    data: Data = None,
    concurrency: Annotated[
        int | None, typer.Option(help="Jobs at a time [MODALBASE_WORKER_CONCURRENCY]")
    ] = None,
    threads: Annotated[
        int | None, typer.Option(help="Threads of a job's linear algebra [MODALBASE_JOB_THREADS]")
    ] = None,
    queues: Annotated[
        str | None, typer.Option(help="Queues to serve, separated by commas; all by default")
    ] = None,
) -> None:
    """Run a worker. Any number may run, on any machine that reaches the database."""
    from service.app.serving import UnknownQueueError, work

    settings = partial(settings_of, data=data, worker_concurrency=concurrency, job_threads=threads)
    try:
        work(settings, queues.split(",") if queues else None)
    except UnknownQueueError as error:
        stop_with(f"--queues {queues}: {error}", 2)
