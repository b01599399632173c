"""Every block of the documents runs as it stands: Python, the shell, JSON against the service's
schemas.

In the short run they are compiled, and their commands and options are there: tests of the library
and of the commands run what they call.

All pages share one service. The page of the command line goes first, as its commands make the
project, structure and campaign that the others name. A block marked `text` is one that nothing can
run here: a drawing, a table of requests, a command that installs, never ends, or needs a server of
containers.
"""

import configparser
import json
import re
import shlex
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from string import Template
from typing import Any
from uuid import uuid4

import httpx
import numpy as np
import pytest
from scipy.io import wavfile

import modalbase
from modalbase.formats.frfs.mat import frfs_of
from modalbase.formats.tables import Stated
from service.app.supervisor import LocalService
from service.nouns.campaigns.schemas import CampaignIn
from service.nouns.coupons.schemas import CurveCouponIn
from service.nouns.structures.schemas import StructureIn
from service.nouns.structures.shapes import Section
from service.nouns.updates.schemas import RecipeIn
from service.pages.example.paper import uff_file
from tests.support.blocks import AT_HAND, PAGES, Block, blocks
from tests.support.command import modalbase_here, run_as_typed
from tests.support.places import ROOT
from tests.support.rest import client_of, ok
from tests.unit.fecore.signal.test_recording import RATE, recording

BLOCKS = blocks()
FIRST = "docs/command-line.md"
ELSEWHERE = {"README.md": "test_tutorial.py", "docs/tutorial.md": "test_tutorial.py"}
"""Pages whose blocks another test runs, as it looks at what they print."""

NEEDS = {"xarray": "to_xarray", "pandas": "import pandas", "sdypy": "from sdypy"}
STRICT = 'curl() { command curl --fail-with-body -sS "$@"; }\n'
SHELL = set("|<>;&*?(){}~`")  # what makes a line more than a command and its words
LANGUAGES = {"python", "sh", "json", "ini", "text"}


def of(*languages: str) -> list[Block]:
    return [
        block for block in BLOCKS if block.language in languages and block.page not in ELSEWHERE
    ]


class Reader:
    """Somebody with a key of their own, a folder with files of a laboratory, and a shell."""

    def __init__(self, service: LocalService, folder: Path) -> None:
        self.folder, self.api = folder, client_of(service, f"reader-{uuid4().hex}")
        key = self.api.headers["authorization"].split()[1]
        shutil.copytree(ROOT / "examples" / "tutorial", folder, dirs_exist_ok=True)
        (folder / "beam.uff").write_bytes(uff_file())
        (folder / "A1.csv").write_bytes(AT_HAND["docs/coupons.md"]()["data"])
        long = recording([1.0, 4.0, 7.0, 10.0, 13.0, 16.0], [1.0, 0.5, 2.0, 1.0, 0.7, 1.5], 19.0)
        wavfile.write(
            folder / "june.wav", int(RATE), np.round(long.T * 0.25 * 2**31).astype(np.int32)
        )
        self.url = service.url
        self.variables = {
            "MODALBASE_URL": service.url,
            "MODALBASE_API_KEY": key,
            "MODALBASE_DATABASE_URL": service.settings.database_url,
            "URL": service.url,
            "KEY": key,
        }

    def run(self, block: Block) -> None:
        """As a shell does; commands that need nothing of one but its words run without it and in
        this process.
        """
        lines = block.text.replace("\\\n", " ").splitlines()
        plain = all(
            line.startswith("modalbase ") and not set(line.split("#")[0]) & SHELL for line in lines
        )
        if not plain:
            run_as_typed(
                ["bash", "-euo", "pipefail", "-c", STRICT + block.text],
                self.folder,
                **self.variables,
            )
            return
        for line in lines:
            words = [
                Template(word).substitute(self.variables)
                for word in shlex.split(line, comments=True)
            ]
            modalbase_here(*words[1:], cwd=self.folder, code=0, **self.variables)


@pytest.fixture(scope="module")
def reader(service: LocalService, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reader]:
    """With what the page of the command line makes, and what the shell's variables name."""
    found = Reader(service, tmp_path_factory.mktemp("reader"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "200")
        for block in of("sh"):
            if block.page == FIRST:
                found.run(block)
    (project,) = ok(found.api.get("projects"))["items"]
    (structure,) = ok(found.api.get(f"projects/{project['id']}/structures"))["items"]
    campaign = ok(
        found.api.post(
            f"structures/{structure['id']}/campaigns",
            json={"name": "hits", "boundary": "cantilever"},
        )
    )
    batch = ok(
        found.api.post(
            f"structures/{structure['id']}/coupon-batches", json={"name": "0", "constants": ["Ex"]}
        )
    )
    spare = ok(found.api.post("api-keys", json={"name": "spare"}))
    found.variables |= {
        "STRUCTURE": structure["id"],
        "CAMPAIGN": campaign["id"],
        "BATCH": batch["id"],
        "PREFIX": spare["key"].split("_")[1],
        "NAME": f"reader-{uuid4().hex}",
    }
    client_of(service, found.variables["NAME"]).close()
    yield found
    found.api.close()


def test_every_block_says_what_it_is_and_few_are_not_run() -> None:
    counts = Counter(block.language for block in BLOCKS)
    assert set(counts) <= LANGUAGES, [
        str(block) for block in BLOCKS if block.language not in LANGUAGES
    ]
    assert counts["text"] <= 14, [str(block) for block in BLOCKS if block.language == "text"]
    assert counts.total() - counts["text"] >= 40
    command = re.compile(r"^    (modalbase|curl|make) ", re.MULTILINE)
    indented = [page.name for page in PAGES if command.search(page.read_text())]
    assert indented == []  # a command in no fence is one that no test sees
    for block in of("python"):
        compile(block.text, str(block), "exec")


@pytest.mark.long
@pytest.mark.parametrize("block", [block for block in of("sh") if block.page != FIRST], ids=str)
def test_commands_run(block: Block, reader: Reader) -> None:
    if "curl" in block.text and shutil.which("curl") is None:
        pytest.skip("curl is not installed")
    reader.run(block)


@pytest.mark.long
@pytest.mark.parametrize("page", sorted({block.page for block in of("python")}))
def test_python_runs(page: str, reader: Reader, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in reader.variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(reader.folder)
    with modalbase.connect() as lab:
        names: dict[str, Any] = {
            **AT_HAND.get(page, dict)(),
            "api": reader.api,
            "structure": reader.variables["STRUCTURE"],
        }
        if page in ("docs/library.md", "docs/modes.md"):
            names |= of_the_library(lab)
        left_out = []
        for block in of("python"):
            if block.page == page:
                if missing := [
                    name
                    for name, word in NEEDS.items()
                    if word in block.text and not installed(name)
                ]:
                    left_out += missing
                else:
                    code = "\n" * (block.line - 1) + block.text
                    exec(compile(code, str(ROOT / page), "exec"), names)
    LOOKED_AT.get(page, dict.copy)(names)
    if made := names.get("lab"):
        made.connection.close()
    if left_out:
        pytest.skip(f"the other blocks ran; not installed: {', '.join(left_out)}")


def installed(name: str) -> bool:
    try:
        __import__(name)
    except ModuleNotFoundError:
        return False
    return True


def of_the_library(lab: modalbase.Laboratory) -> dict[str, Any]:
    beam = lab.structure("beam")
    f = np.linspace(10.0, 100.0, 91)
    return {
        "beam": beam,
        "campaign": lab.campaign("March"),
        "other": beam.new_campaign("other", "cantilever"),
        "f": f,
        "H": np.ones((1, f.size), dtype=complex),
    }


def looked_at_archives(names: dict[str, Any]) -> None:
    """What was brought in goes again: other pages find their things by name."""
    assert len(names["frfs"]) > 0
    names["lab"].project("heirloom").delete()


def looked_at_coupons(names: dict[str, Any]) -> None:
    assert names["result"].modulus_pa == pytest.approx(40e9, rel=1e-9)


def looked_at_modes(names: dict[str, Any]) -> None:
    assert names["shapes"].shape == (len(names["modes"].modes), len(names["dofs"]))
    assert names["found"].modes.frequency_hz == pytest.approx(names["f_hz"], rel=1e-3)


def looked_at_jobs(names: dict[str, Any]) -> None:
    said: list[float] = []

    class Report:
        restored = None

        def __call__(self, _: str, share: float) -> None:
            said.append(share)

    assert list(names["compute"](None, Report())) == [3]
    assert said[-1] == 1


def looked_at_monitoring(names: dict[str, Any]) -> None:
    assert names["watch"].name == "stringer 1"


def looked_at_footbridge(names: dict[str, Any]) -> None:
    first = names["deck"].alarms()[-1]
    assert first.parameter == "frequency_1"
    assert first.details["performed_at"].startswith("2026-11-07")


LOOKED_AT: dict[str, Callable[[dict[str, Any]], Any]] = {
    "docs/archives.md": looked_at_archives,
    "docs/coupons.md": looked_at_coupons,
    "docs/modes.md": looked_at_modes,
    "docs/jobs.md": looked_at_jobs,
    "docs/monitoring.md": looked_at_monitoring,
    "docs/watched-footbridge.md": looked_at_footbridge,
    "docs/monitoring-charts.md": lambda names: names["found"].parameters["Ex"],
    "docs/forward-model.md": lambda names: names["H"].shape == (1, 3200),
}


def test_json_is_what_the_service_takes(api: httpx.Client) -> None:
    """Recipes and coupons by their schemas; what names things is sent, and only the things are
    missing.
    """
    shown: dict[str, list[Any]] = {}
    for block in of("json"):
        shown.setdefault(block.page, []).append(
            json.loads(block.text.replace('"…"', f'"{uuid4()}"'))
        )
    stated, mapping, magnitudes = shown.pop("docs/hammer.md")
    assert Stated.of(stated["table"], "mapping.table").decimal == ","
    columns = {
        name: np.arange(8.0) for name in ("Frequency", "Mag 2", "Mag 3", "Phase 2", "Phase 3")
    }
    assert len(frfs_of(columns, magnitudes, "accelerance").values) == 2
    table = np.ones((3, 8))
    exported = {
        "m.f": np.arange(8.0),
        "m.H": table + 1j,
        "m.coh": table,
        "m.points": np.arange(1, 4),
    }
    assert len(frfs_of(exported, mapping, "accelerance").values) == 3
    plate, recipe, pieces, added, zones = shown.pop("docs/plies.md")
    shaped, sections = shown.pop("docs/own-model.md")
    for section in sections.values():
        Section.model_validate(section)
    for structure in (plate, {**plate, **pieces}, shaped):
        StructureIn.model_validate(structure)
    CampaignIn.model_validate({"name": "x", "boundary": "free", **added})
    for one in (recipe, zones, *shown.pop("docs/updating.md")):
        RecipeIn.model_validate(one)
    (about,) = shown.pop("docs/command-line.md")
    for one in about.pop("specimens").values():
        CurveCouponIn.model_validate({"specimen": "A3", **about, **one})
    refused = api.post("update-jobs", json=shown.pop("docs/campaigns-together.md")[0])
    assert refused.status_code in (404, 422)
    assert {error["pointer"] for error in refused.json().get("errors", [])} <= {
        "/jobs/0/campaign_id",
        "/jobs/1/campaign_id",
    }
    assert not shown, "a page whose JSON nothing reads"


def test_units_of_systemd_are_read() -> None:
    for block in of("ini"):
        parser = configparser.ConfigParser()
        parser.read_string(block.text)
        assert parser["Service"]["ExecStart"].split()[1] in ("up", "watch")


def test_a_reader_of_the_guide_finds_every_command_that_exists() -> None:
    """Blocks name commands and options that are there."""
    from typer.main import get_command

    from service.app.cli.command import app

    root = get_command(app)
    for block in of("text", "sh"):
        text = block.text.replace("\\\n", " ")
        for line in re.findall(r"(?:^|/)modalbase +(.+?)(?: *[#|].*)?$", text, re.MULTILINE):
            words, command = line.split(), root
            while words and words[0] in getattr(command, "commands", {}):
                command = command.commands[words.pop(0)]  # type: ignore[attr-defined]
            options = {name for option in command.params for name in option.opts}
            assert command is not root, f"{block}: {line}"
            used = {word.split("=")[0] for word in words if word.startswith("--")}
            assert used <= options | {"--help", "--version"}, f"{block}: {line}"
