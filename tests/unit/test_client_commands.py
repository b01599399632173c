"""What the commands and the library send, print and end with, over answers as the REST contract has
them.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console
from typer.main import get_command

import modalbase
from modalbase.client.connection import Connection
from modalbase.client.display import print_table
from modalbase.client.endpoint import NO_SERVICE, checked_key, find_endpoint
from modalbase.client.errors import ClientError, Exit
from modalbase.objects.campaigns import Campaign
from modalbase.objects.jobs import Import, ModeSet
from modalbase.objects.laboratory import Laboratory
from modalbase.objects.projects import Structure
from modalbase.objects.thing import Figure, Table
from service.app.cli.command import app

ID = "0198c6a2-0000-7000-8000-000000000001"
JOB = {
    "id": ID, "status": "succeeded", "stage": None, "progress": 1.0, "created_at": "2026-03-02T12:00:00Z", "error": None,
    "campaign_name": "March",
}  # fmt: skip
SENT = JOB | {"status": "queued", "already_imported": False, "filename": "a.uff"}
READ = SENT | {
    "status": "succeeded", "counts": {"frfs": 3}, "warnings": ["two FRFs are alike"], "dry_run": False,
    "found": {"variables": {"force": "float64 [3, 256]"}, "mapping": {"channels": []}, "blocks": None},
    "datasets": [
        {"number": 1, "type": 58, "outcome": "stored", "reason": None},
        {"number": 2, "type": 99, "outcome": "refused", "reason": "is unknown"},
    ],
}  # fmt: skip
LOST = READ | {
    "status": "failed",
    "counts": None,
    "error": {"detail": "is no UFF file"},
    "warnings": [],
    "datasets": [],
}
HITS = {
    "hits": [
        {
            "point": 3,
            "hit": 1,
            "accepted": False,
            "findings": [{"failed": True, "sentence": "A double hit."}],
        }
    ]
}


@dataclass
class Lab:
    """A service that answers as it is set up, and remembers what it was asked."""

    answers: dict[str, Any]
    asked: list[httpx.Request] = field(default_factory=list)

    def __call__(self, request: httpx.Request) -> httpx.Response:
        request.read()
        self.asked.append(request)
        answer = self.answers[f"{request.method} {request.url.path.removeprefix('/api/v1/')}"]
        if isinstance(answer, bytes):
            return httpx.Response(200, content=answer)
        return httpx.Response(200, json=answer, headers={"etag": '"1"'})

    def sent(self) -> str:
        """The last request's method, path and query."""
        last = self.asked[-1]
        return f"{last.method} {str(last.url).partition('/api/v1/')[2]}"


def items(*found: dict[str, Any]) -> dict[str, Any]:
    return {"items": list(found), "next_cursor": None}


ALARM = {
    "id": ID, "created_at": "", "monitor_name": "m", "parameter": "Ex", "state": "acknowledged", "acknowledged_by": "ada",
    "note": "known",
}  # fmt: skip


@pytest.fixture
def lab(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Lab:
    there = Lab(
        {
            "GET projects": items(),
            "GET update-jobs": items(JOB),
            f"GET update-jobs/{ID}/cards": b"$ deck",
            f"GET update-jobs/{ID}/report": b"%PDF",
            f"GET update-jobs/{ID}/figures": items(
                {"name": "frf", "title": "", "available": True, "reason": None}
            ),
            f"GET update-jobs/{ID}/figures/frf": b"<svg/>",
            f"POST update-jobs/{ID}/cancel": JOB,
            f"POST update-jobs/{ID}/retry": JOB,
            f"POST campaigns/{ID}/update-jobs": JOB,
            f"POST campaigns/{ID}/imports": SENT,
            f"GET imports/{ID}": READ,
            f"GET imports/{ID}/records": HITS,
            f"GET campaigns/{ID}/grid-points": items(),
            f"POST campaigns/{ID}/processings": JOB,
            f"GET processings/{ID}": JOB,
            f"GET mode-sets/{ID}": {
                "id": ID,
                "name": "first",
                "origin": "typed",
                "modes": [],
                "details": {},
            },
            f"POST monitors/{ID}/runs": items(),
            f"POST alarms/{ID}/acknowledge": ALARM,
        }
    )
    client = partial(httpx.Client, transport=httpx.MockTransport(there))
    monkeypatch.setattr("modalbase.client.connection.httpx.Client", client)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.uff").write_text("-1\n")
    (tmp_path / "mapping.json").write_text("{}")
    return there


@cache
def commands() -> Any:
    return get_command(app)  # a twentieth of a second each time


def run(line: str, code: int = 0) -> tuple[str, str]:
    around = {"MODALBASE_URL": "http://lab:8000", "MODALBASE_API_KEY": "mb_1_2"}
    done = CliRunner().invoke(commands(), line.split(), env=around)
    if code:
        assert isinstance(done.exception, ClientError), done.output
        assert done.exception.code == code
        return done.stdout, f"{done.stderr}{done.exception}"
    assert done.exit_code == 0, done.exception
    return done.stdout, done.stderr


WRITTEN = [
    ("cards --out beam.bdf", "beam.bdf", f"GET update-jobs/{ID}/cards?format=nastran"),
    (
        f"cards {ID} --out beam.txt --format abaqus",
        "beam.txt",
        f"GET update-jobs/{ID}/cards?format=abaqus",
    ),
    ("report", "report.pdf", f"GET update-jobs/{ID}/report?format=pdf"),
    ("figure frf --out a.png", "a.png", f"GET update-jobs/{ID}/figures/frf?format=png"),
]


@pytest.mark.parametrize(("line", "file", "asked"), WRITTEN)
def test_a_file_is_written_and_named_or_described_in_json(
    lab: Lab, line: str, file: str, asked: str
) -> None:
    assert run(line)[0] == f"{file}\n"
    assert lab.sent() == asked
    assert json.loads(run(f"{line} --json")[0]) == {
        "file": file,
        "bytes": Path(file).stat().st_size,
    }


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "cards --out beam.txt",
            "state the program: 'beam.txt' does not end in one of .inp, .bdf, .dat, .nas",
        ),
        ("report --out r.doc", "--out 'r.doc' does not end in one of .html, .htm, .pdf"),
        ("figure frf --out a.gif", "--out 'a.gif' does not end in one of .svg, .png, .pdf, .json"),
        (
            "export March --what original --out a.uff",
            "'March' is no id of an import; `modalbase import` prints them",
        ),
        (
            "result March",
            (
                "'March' is no id, expected one such as 0198c6a2-… or latest; `modalbase jobs`"
                " lists them"
            ),
        ),
        (
            "alarms --acknowledge March --note known",
            "--acknowledge takes the id of an alarm, and --note what is done",
        ),
        (
            f"alarms --acknowledge {ID}",
            "--acknowledge takes the id of an alarm, and --note what is done about it",
        ),
    ],
)
@pytest.mark.usefixtures("lab")
def test_what_cannot_be_meant_is_said_and_writes_nothing(line: str, message: str) -> None:
    before = sorted(Path.cwd().iterdir())
    out, err = run(line, Exit.USAGE)
    assert (out, message in err) == ("", True), err
    assert sorted(Path.cwd().iterdir()) == before


def test_json_stands_alone_on_standard_output(lab: Lab) -> None:
    assert run("projects --json") == ("[]\n", "")
    for line, found in (
        (f"modes {ID} --mode-set {ID}", lab.answers[f"GET mode-sets/{ID}"]),
        (f"points {ID}", {"items": []}),
        (f"update {ID}", JOB),
        ("figure list", lab.answers[f"GET update-jobs/{ID}/figures"]["items"]),
        (f"hits a.uff --campaign {ID} --mapping mapping.json", HITS["hits"]),
        (f"monitors --run {ID}", []),
    ):
        assert json.loads(run(f"{line} --json")[0]) == found


def test_jobs_monitors_and_alarms_are_acted_upon(lab: Lab) -> None:
    for line, asked in (
        (f"jobs --cancel {ID}", f"POST update-jobs/{ID}/cancel"),
        ("jobs --retry latest", f"POST update-jobs/{ID}/retry"),
        (f"alarms --acknowledge {ID} --note known", f"POST alarms/{ID}/acknowledge"),
    ):
        assert ID in run(line)[0]
        assert lab.sent() == asked
    assert json.loads(lab.asked[-1].content) == {"note": "known"}
    assert (
        "no campaign waits: a monitor takes those that state when" in run(f"monitors --run {ID}")[1]
    )
    lab.answers[f"POST monitors/{ID}/runs"] = items(
        {"campaign_id": "c1", "state": "queued", "message": None}
    )
    out, err = run(f"monitors --run {ID}")
    assert ("c1" in out, err) == (True, "")


def test_hits_are_looked_at_first_and_made_into_frfs_when_asked(lab: Lab) -> None:
    out, err = run(f"hits a.uff --campaign {ID}", Exit.USAGE)
    assert '"mapping"' in out
    assert (
        "nothing is stored: save `mapping` of this, corrected, and state it with --mapping" in err
    )
    assert "dry_run=true&kind=hits" in str(next(r.url for r in lab.asked if r.method == "POST"))
    out, err = run(f"hits a.uff --campaign {ID} --mapping mapping.json")
    assert "A double hit." in out
    assert err.split("next: modalbase ")[1:] == [
        f'points "{ID}" POINTS.csv\n',
        f'hits FILE --campaign "{ID}" --process\n',
    ]
    lab.answers[f"GET campaigns/{ID}/grid-points"] = items({"label": 3})
    err = run(f"hits a.uff --campaign {ID} --mapping mapping.json --process")[1]
    assert err.split("next: modalbase ")[1:] == [f'modes "{ID}" --identify\n']


def test_an_import_says_what_was_refused_and_what_failed(lab: Lab) -> None:
    err = run(f"import a.uff --campaign {ID}")[1]
    assert "a.uff: two FRFs are alike\na.uff: dataset 2 (type 99): is unknown\n" in err
    assert "next: modalbase update" in err
    lab.answers[f"GET imports/{ID}"] = READ | {"dry_run": True}
    out = run(f"import a.uff --campaign {ID} --dry-run --kind hits --mapping mapping.json")[0]
    assert '"force": "float64 [3, 256]"' in out
    lab.answers[f"GET imports/{ID}"] = LOST
    err = run(f"import a.uff --campaign {ID}", Exit.FAILED)[1]
    assert "a.uff: is no UFF file\n" in err
    assert "1 of 1 imports did not succeed: a.uff" in err
    assert "next:" not in err


def test_the_library_sends_what_it_is_given(lab: Lab) -> None:
    there = Laboratory(Connection("http://lab:8000", "mb_1_2"))
    campaign = Campaign(there, {"id": ID})
    read = campaign.import_file("a.uff", dry_run=True).summary()
    assert read == "a.uff: 3 frfs\ndataset 2 (type 99) refused: is unknown\ntwo FRFs are alike"
    assert "dry_run=true" in str(lab.asked[0].url)
    for fields, words in (
        (LOST, "import failed: is no UFF file"),
        (LOST | {"status": "running", "stage": "reading"}, "import: reading"),
        (LOST | {"status": "queued"}, "import: queued"),
    ):
        assert Import(there, fields).summary() == words
    with pytest.raises(
        ClientError, match=r"frfs\(\) has arrays; export\(\) writes a file in a format"
    ):
        campaign.frfs(format="csv")
    figure = Figure(there, f"update-jobs/{ID}/figures/frf", {})
    with pytest.raises(ClientError, match=r"'a.gif' does not end in one of .svg, .png"):
        figure.save("a.gif")
    assert figure.save("a.svg").read_bytes() == b"<svg/>"
    lab.answers[f"POST structures/{ID}/campaigns"] = {"id": ID}
    Structure(there, {"id": ID}).new_campaign(
        "May", "free", sensor_point=3, window_rate_per_s=2.0, notes="wet"
    )
    assert json.loads(lab.asked[-1].content) == {
        "name": "May", "boundary": "free", "instruments": {"sensor_point": 3}, "inputs": {"window_rate_per_s": 2.0},
        "notes": "wet",
    }  # fmt: skip
    lab.answers[f"PUT campaigns/{ID}/grid-points"] = items({"label": 1})
    assert campaign.set_grid_points([(1, 0.1, 0, 0)]).column("label") == [1]
    assert lab.asked[-1].headers["if-match"] == '"1"'  # that of the points that are replaced


def test_shapes_have_a_place_for_each_dof_and_gaps_where_nothing_is_known() -> None:
    value = {"point": 7, "direction": 3, "real": 1.0, "imag": -2.0}
    modes = [
        {"shape": [value, value | {"point": 2}]},
        {"shape": None},
        {"shape": [value | {"real": 5.0}]},
    ]
    dofs, found = ModeSet(None, {"modes": modes}).shapes()
    assert dofs == [(2, 3), (7, 3)]
    gap = np.nan
    np.testing.assert_array_equal(found, [[1 - 2j, 1 - 2j], [gap, gap], [gap, 5 - 2j]])


def test_a_table_shows_what_its_rows_have_or_what_it_is_given(
    capsys: pytest.CaptureFixture[str],
) -> None:
    rows: list[dict[str, Any]] = [{"name": "Ex", "value": 1.5}, {"name": "Ey", "unit": "Pa"}]
    assert str(Table(rows)).split() == ["name", "value", "unit", "Ex", "1.5", "–", "Ey", "–", "Pa"]
    assert "<th>name</th><th>value</th><th>unit</th>" in Table(rows)._repr_html_()
    print_table("t", ("a",), [[1]], Console(force_terminal=True, width=20))
    assert "t\n" in capsys.readouterr().out


def test_without_service_and_key_it_is_said_how_to_get_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("MODALBASE_URL", "MODALBASE_API_KEY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MODALBASE_PROFILE", str(tmp_path / "profile.json"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    wrong: list[tuple[Callable[[], object], str]] = [
        (find_endpoint, NO_SERVICE),
        (lambda: checked_key("mb_ä"), "the API key holds characters that no key has"),
        (lambda: modalbase.connect("ftp://lab"), "'ftp://lab' is no URL such as http"),
    ]
    for act, words in wrong:
        with pytest.raises(ClientError) as refused:
            act()
        assert words in str(refused.value)
