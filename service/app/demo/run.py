"""`modalbase demo`: a service of its own on a free port and in a folder of its own, the main job,
and the end of both.
"""

import json
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import typer
from rich.console import Console

from modalbase.client.results import print_result
from modalbase.objects import laboratory
from modalbase.objects.jobs import UpdateJob, Watch
from service.app.supervisor import LocalService
from service.pages.example import paper
from service.pages.example.paper import UPDATED
from service.platform.settings import Settings


@dataclass
class Laboratory:
    """A client of the service that notes how long each step took."""

    client: httpx.Client  # with the service's URL as base, and a key
    durations: dict[str, float] = field(default_factory=dict)  # seconds by step

    def update_beam(self, watch: Watch | None = None) -> dict[str, Any]:
        """The whole main job: from nothing to the result document.

        Args:
            watch: called with the stage and the share that is done while a job runs.

        Raises:
            ClientError: a call was refused, or a job failed.
        """
        lab = laboratory.Laboratory.over(self.client)
        with self._step("project, structure, campaign"):
            structure = lab.new_project("demonstration").new_structure(**paper.STRUCTURE)
            campaign = structure.new_campaign(**paper.CAMPAIGN)
        with self._step("import of 33 FRFs"), tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "paper_beam.uff")
            file.write_bytes(paper.uff_file())
            campaign.import_file(file, wait=False).wait(watch).check()
        with self._step("modes and coupons"):
            modes = campaign.new_mode_set("Table 3", paper.MODES)
            published = {name: {"mean": mean} for name, mean in paper.COUPONS_PA.items()}
            batch = structure.new_coupon_batch(
                "Table 4", list(paper.COUPONS_PA), published=published
            )
        with self._step("update job"):
            job = campaign.update(mode_set=modes, prior_from_coupon_batch=batch).wait(watch)
            return dict(job.result().document)

    @contextmanager
    def _step(self, name: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self.durations[name] = time.perf_counter() - began


PLAIN_WIDTH = 120  # columns where the output is no terminal, so that no table is cut

PURPOSE = """\
The demonstration takes a cantilever of fibre reinforced plastic (Mondal and Chakraborty, 2015) from an empty
database to an updated model: a UFF file of 33 FRFs, modes and coupon results go in by REST; constants and damping
with their uncertainty come out. It starts a service of its own and leaves nothing behind."""

LAW = """\
The published a1 is 11 µs, and a beam with it would have 3.4 % of damping in its mode at 868 Hz, where the same paper
measured 1.26 %: the values above follow the paper's own measured damping, not its print (docs/errata.md)."""

NEXT = """\
next: modalbase up            a service of your own, which keeps what it is given
      docs/tutorial.md        from your analyser's export to a report in ten minutes
      modalbase demo --keep   the same again, and the service stays up to look around"""


def run_demo(*, as_json: bool, keep: bool) -> None:
    """Run the demonstration.

    Args:
        as_json: print the result document, alone, on standard output; everything else goes to
            standard error.
        keep: leave the service up until Ctrl-C, to look around.

    Raises:
        StartError: the service did not start.
        ClientError: a step failed.
    """
    console = Console(stderr=as_json)
    if not console.is_terminal:
        console = Console(stderr=as_json, width=PLAIN_WIDTH)
    with ExitStack() as stack:
        folder = Path(tempfile.mkdtemp(prefix="modalbase-demo-"))
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        console.print(PURPOSE, highlight=False)
        began = time.perf_counter()
        with console.status("starting PostgreSQL, the API and a worker"):
            service = stack.enter_context(
                LocalService(_settings(folder), log_file=folder / "service.log")
            )
            key = service.new_key("demonstration")
        starting = time.perf_counter() - began
        console.print(f"modalbase runs at {service.url}", highlight=False)
        # a proxy of the environment must not come between
        headers = {"Authorization": f"Bearer {key}"}
        client = stack.enter_context(
            httpx.Client(base_url=service.url, headers=headers, timeout=60, trust_env=False)
        )
        laboratory = Laboratory(client, {"start of database, API and worker": starting})
        document = laboratory.update_beam()
        _show(console, document, laboratory.durations)
        console.print(
            f"report: {_report(client, document['provenance']['update_job'])}",
            highlight=False,
            soft_wrap=True,
        )
        if as_json:
            typer.echo(json.dumps(document))
        if keep:
            _stay(console, service, key)


def _report(client: httpx.Client, job: str) -> Path:
    """Leave the result's report behind, in a file of its own among the temporary ones."""
    with tempfile.NamedTemporaryFile(
        prefix="modalbase-demo-report-", suffix=".pdf", delete=False
    ) as file:
        lab = laboratory.Laboratory.over(client)
        return lab.named(UpdateJob, job).report(file.name)


def _settings(folder: Path) -> Settings:
    """A folder of its own; a database that the user's environment names has no part in it."""
    return Settings(data=folder, host="127.0.0.1", port=0, database_url=None, log_level="warning")


def _show(console: Console, document: dict[str, Any], durations: dict[str, float]) -> None:
    print_result(
        "updated parameters, beside the paper's", document, published=UPDATED, console=console
    )
    console.print(f"\n{LAW}", highlight=False)
    steps = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in durations.items())
    console.print(f"\n{steps}; {sum(durations.values()):.2f} s together", highlight=False)
    console.print(NEXT, highlight=False, markup=False)


def _stay(console: Console, service: LocalService, key: str) -> None:
    console.print(
        f"documentation  {service.url}/docs\nAPI key        {key}\nCtrl-C ends it.", highlight=False
    )
    try:
        while True:
            for line in service.tend():
                console.print(line, highlight=False)
            time.sleep(0.2)
    except KeyboardInterrupt:
        console.print("ended")
