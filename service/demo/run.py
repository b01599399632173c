"""`modalbase demo`: a service of its own on a free port and in a folder of its own, the main job, and the end of both."""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from modalbase.client.results import print_result
from service.demo.laboratory import Laboratory
from service.demo.paper import UPDATED
from service.settings import Settings
from service.supervisor import LocalService

PLAIN_WIDTH = 120  # columns where the output is no terminal, so that no table is cut


def run_demo(*, as_json: bool, keep: bool) -> None:
    """Run the demonstration.

    Args:
        as_json: print the result document, alone, on standard output; everything else goes to standard error.
        keep: leave the service up until Ctrl-C, to look around.

    Raises:
        StartError: the service did not start.
        DemoError: a step failed.
    """
    console = Console(stderr=as_json)
    if not console.is_terminal:
        console = Console(stderr=as_json, width=PLAIN_WIDTH)
    with ExitStack() as stack:
        folder = Path(tempfile.mkdtemp(prefix="modalbase-demo-"))
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        began = time.perf_counter()
        # A proxy of the environment must not come between us and our own machine, nor a database of the user's.
        settings = Settings(data=folder, host="127.0.0.1", port=0, database_url=None, log_level="warning")
        service = stack.enter_context(LocalService(settings, log_file=folder / "service.log"))
        key = service.new_key("demonstration")
        starting = time.perf_counter() - began
        console.print(f"modalbase runs at {service.url}", highlight=False)
        client = stack.enter_context(
            httpx.Client(
                base_url=service.url,
                headers={"Authorization": f"Bearer {key}"},
                timeout=60,
                trust_env=False,
            )
        )
        laboratory = Laboratory(client, {"start of database, API and worker": starting})
        result = _with_progress(console, laboratory)
        print_result("updated parameters, beside the paper's", result, published=UPDATED, console=console)
        steps = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in laboratory.durations.items())
        console.print(f"{steps}; {sum(laboratory.durations.values()):.2f} s together", highlight=False)
        if as_json:
            typer.echo(json.dumps(result))
        if keep:
            _stay(console, service, key)


def _with_progress(console: Console, laboratory: Laboratory) -> dict[str, Any]:
    columns = (TextColumn("{task.description:<32}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task("starting", total=1.0)
        return laboratory.update_beam(lambda stage, share: progress.update(bar, description=stage, completed=share))


def _stay(console: Console, service: LocalService, key: str) -> None:
    console.print(f"documentation  {service.url}/docs\nAPI key        {key}\nCtrl-C ends it.", highlight=False)
    try:
        while True:
            for line in service.tend():
                console.print(line, highlight=False)
            time.sleep(0.2)
    except KeyboardInterrupt:
        console.print("ended")
