"""What is shown and handed out is what it was: figures, reports, pages, exports, the OpenAPI
document, the commands.
"""

import io
from collections.abc import Callable, Iterator
from typing import Any
from uuid import uuid4

import httpx
import numpy as np
import pytest
import typer

from service.app.cli.command import app
from service.app.demo.run import Laboratory
from service.app.supervisor import LocalService
from tests.golden.inputs import hits_campaign, job
from tests.support import contract
from tests.support.golden import check
from tests.support.golden_parts import answered, beginning, exact, numeric, page_lines
from tests.support.rest import client_at, ok, session_client
from tools.reference import document


@pytest.fixture(scope="module")
def api(service: LocalService) -> Iterator[httpx.Client]:
    """A client of one user for all of them."""
    with client_at(service.url, service.new_key(f"golden {uuid4()}")) as client:
        yield client


@pytest.fixture
def another(service: LocalService) -> Iterator[httpx.Client]:
    """A client of another user, whose projects the pages of the first do not list."""
    with client_at(service.url, service.new_key(f"golden {uuid4()}")) as client:
        yield client


@pytest.fixture(scope="module")
def papers_test(api: httpx.Client, service: LocalService) -> dict[str, Any]:
    """The result of the main job as the demonstration does it: typed modes, priors of coupons."""
    with httpx.Client(
        base_url=service.url, headers=api.headers, timeout=60, trust_env=False
    ) as client:
        return Laboratory(client).update_beam()


@pytest.fixture(scope="module")
def done(papers_test: dict[str, Any]) -> dict[str, Any]:
    """Where that result is from."""
    found: dict[str, Any] = papers_test["provenance"]
    return found


@pytest.fixture(scope="module")
def identified(api: httpx.Client, done: dict[str, Any]) -> str:
    """The address of an identification of the same FRFs."""
    return job(api, f"campaigns/{done['campaign']}/identifications", {"name": "found"})[0]


def test_the_papers_test(papers_test: dict[str, Any]) -> None:
    check("update-paper-test", papers_test)


def test_figures(api: httpx.Client, done: dict[str, Any], identified: str) -> None:
    listed = ok(api.get(f"update-jobs/{done['update_job']}/figures"))["items"]
    drawn = {
        each["name"]: ok(api.get(api.base_url.join(each["href"])))
        for each in listed
        if each["available"]
    }
    more = {
        "identification": ok(api.get(f"{identified}/figures/stabilisation")),
        "dark": ok(
            api.get(f"update-jobs/{done['update_job']}/figures/mac", params={"theme": "dark"})
        ),
        "files": {
            kind: answered(
                api.get(
                    f"update-jobs/{done['update_job']}/figures/damping", params={"format": kind}
                ),
                None,
            )
            for kind in ("svg", "png", "pdf")
        },
    }
    check(
        "figures", {"listed": listed, **drawn, **more, "shapes": without_numbers(drawn["shapes"])}
    )


def without_numbers(value: Any) -> Any:
    """A figure of shapes, which have no sign of their own."""
    if isinstance(value, dict):
        return {name: without_numbers(each) for name, each in value.items()}
    if isinstance(value, list):
        return [without_numbers(each) for each in value]
    return (
        value.lstrip("+-") if isinstance(value, str) else 0.0 if isinstance(value, float) else value
    )


def test_figures_of_hits(another: httpx.Client) -> None:
    campaign = hits_campaign(another, "hits-plate-one-point")
    check("figures-hits", ok(another.get(f"campaigns/{campaign}/figures/hits")))


@pytest.mark.long
def test_reports(api: httpx.Client, done: dict[str, Any]) -> None:
    """As a page: paper has the same words of the same template. In short `test_figures.py` of
    `tests/integration` reads one.
    """
    page = api.get(f"update-jobs/{done['update_job']}/report")
    check("report", {"html": answered(page, page_lines(page.text))})


def arrays(content: bytes) -> dict[str, Any]:
    """An npz file."""
    with np.load(io.BytesIO(content)) as file:
        return {
            name: file[name] if file[name].dtype.kind in "fciub" else file[name].tolist()
            for name in file
        }


def test_exports_of_what_was_measured(api: httpx.Client, done: dict[str, Any]) -> None:
    """To the byte, but for ids and times in them."""
    campaign = f"campaigns/{done['campaign']}"
    (sent,) = ok(api.get(f"{campaign}/imports"))["items"]
    first = ok(api.get(f"{campaign}/frfs", params={"reference": 7}))["items"][0]["id"]
    part = {"fmin": 100, "fmax": 200, "stride": 2}
    wanted: dict[str, tuple[str, dict[str, Any], Callable[[bytes], Any]]] = {
        "points csv": (f"{campaign}/grid-points", {"format": "csv"}, exact),
        "points json": (f"{campaign}/grid-points", {"format": "json"}, numeric),
        "original": (f"imports/{sent['id']}/original", {}, exact),
    }
    for kind, read in {
        "json": numeric,
        "npz": arrays,
        "csv": exact,
        "arrow": exact,
        "uff": exact,
    }.items():
        wanted[f"frfs {kind}"] = f"{campaign}/frfs/data", {"format": kind}, read
        wanted[f"frf {kind}"] = f"frfs/{first}/data", {"format": kind, **part}, read
    found = {}
    for name, (path, params, read) in wanted.items():
        answer = api.get(path, params=params)
        found[name] = answered(answer, read(answer.content))
    answer = api.get(f"{campaign}/frfs/data", headers={"Accept": "text/csv"})
    found["accepted"] = answered(answer, exact(answer.content))
    check("exports-measured", found)


def test_exports_of_time_blocks(another: httpx.Client) -> None:
    campaign = hits_campaign(another, "hits-plate-one-point")
    row = ok(another.get(f"campaigns/{campaign}/records"))["items"][0]["id"]
    answers = {
        kind: another.get(f"records/{row}/data", params={"format": kind}) for kind in ("npz", "csv")
    }
    check(
        "exports-records",
        {kind: answered(each, exact(each.content)) for kind, each in answers.items()},
    )


def test_exports_of_what_was_computed(
    api: httpx.Client, done: dict[str, Any], identified: str
) -> None:
    """By their numbers."""
    path = f"update-jobs/{done['update_job']}"
    found = {}
    for model in ("initial", "updated"):
        answer = api.get(f"{path}/frfs/data", params={"format": "npz", "model": model})
        found[model] = answered(answer, arrays(answer.content))
    for kind, read in (("csv", numeric), ("uff", beginning)):
        answer = api.get(f"{path}/frfs/data", params={"format": kind, "reference": 7, "stride": 10})
        found[kind] = answered(answer, read(answer.content))
    answer = api.get(f"mode-sets/{ok(api.get(identified))['mode_set']}", params={"format": "uff"})
    found["modes uff"] = answered(answer, numeric(answer.content))
    for kind, element in (
        ("calculix", "shell"),
        ("calculix", "solid"),
        ("abaqus", "shell"),
        ("nastran", "shell"),
    ):
        answer = api.get(f"{path}/cards", params={"format": kind, "element": element})
        found[f"{kind} {element}"] = answered(answer, numeric(answer.content))
    check("exports-computed", found)


@pytest.mark.usefixtures("identified")  # the campaign's page shows it
def test_pages(api: httpx.Client, service: LocalService, done: dict[str, Any]) -> None:
    campaign, result = done["campaign"], done["update_job"]
    (read,) = ok(api.get(f"campaigns/{campaign}/imports"))["items"]
    structure = ok(api.get(f"campaigns/{campaign}"))["structure_id"]
    project = ok(api.get(f"structures/{structure}"))["project_id"]
    paths = {
        "start": "", "projects": "projects", "project": f"projects/{project}", "structure": f"structures/{structure}",
        "campaign": f"campaigns/{campaign}", "points": f"campaigns/{campaign}/grid-points", "import": f"imports/{read['id']}",
        "form": f"campaigns/{campaign}/update", "jobs": "update-jobs", "result": f"update-jobs/{result}", "new": "new",
        "compare": f"compare?job={result}", "monitors": "monitors", "keys": "keys",
    }  # fmt: skip
    found, before = {}, set[str]()
    with session_client(api, base=service.url) as browser:
        for name, path in paths.items():
            answer = browser.get(f"/ui/{path}")
            text = page_lines(answer.text)
            new = [line for line in dict.fromkeys(text) if line not in before]
            before.update(new)
            found[name] = {"status": answer.status_code, "lines": len(text), "not before": new}
    check("pages", found)


def test_the_openapi_document() -> None:
    """What it promises is kept: an addition is a line of the contract, anything else breaks what
    relies on it.
    """
    contract.check(contract.Contract(document()))


def test_the_commands() -> None:
    check("commands", dict(commands(typer.main.get_command(app), "modalbase")))


def commands(command: Any, words: str) -> Iterator[tuple[str, Any]]:
    """Each command with what it takes; `docs/reference-cli.md` says what for."""
    for name, one in getattr(command, "commands", {}).items():
        yield from commands(one, f"{words} {name}")
    yield words, [parameter(one) for one in command.params]


def parameter(one: Any) -> str:
    """An argument or option of a command: names, type, whether it is required, repeated, and its
    default.
    """
    words = [*one.opts, *one.secondary_opts, one.type.name, *["required"] * one.required]
    words += ["repeated"] * (one.multiple or one.nargs != 1)
    default = None if callable(one.default) else one.default
    return " ".join([*words, *([f"= {default}"] if default not in (None, False) else [])])
