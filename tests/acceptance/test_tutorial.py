"""What a newcomer runs: the tutorial from the wheel alone, README's script and picture, the
demonstration, a notebook.
"""

import json
import re
import shlex
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from runpy import run_path
from unittest.mock import patch

import httpx
import numpy as np
import pytest

from examples import make_tutorial
from modalbase.formats.uff import Frf, GridPoint, read_file
from service.app.supervisor import LocalService
from tests.support.command import modalbase_here, run_as_typed
from tests.support.lengths import long
from tests.support.places import ROOT

PAGE = (ROOT / "docs" / "tutorial.md").read_text()
FILES = ROOT / "examples" / "tutorial"
MAKE = {"projects", "structures", "campaigns", "points", "import", "coupons"}
TRUTH = {
    **{name: getattr(make_tutorial.TRUTH, name) for name in ("Ex", "Ey", "Gxy", "Gxz")},
    "a0": make_tutorial.A0,
    "a1": make_tutorial.A1,
}


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)


@pytest.fixture(params=[False, long(True)])
def printed(
    service: LocalService, api: httpx.Client, tmp_path: Path, request: pytest.FixtureRequest
) -> dict[str, str]:
    """What each command of the page prints, in a folder with the shipped files alone; in the long
    run the first by the wheel alone, as a shell does, and a report, as of the demonstration.
    """
    folder = tmp_path / "beam"
    shutil.copytree(FILES, folder)
    ours = {
        "MODALBASE_URL": service.url,
        "MODALBASE_API_KEY": api.headers["authorization"].split()[1],
        "COLUMNS": "200",
    }
    first, *more = "".join(blocks("sh")).splitlines()
    shown = []
    if request.param:
        unpacked = str(request.getfixturevalue("unpacked"))
        run_as_typed(first.replace("bridge deck", "wheel"), folder, **ours, PYTHONPATH=unpacked)
    else:
        more = [line for line in more if not line.startswith("modalbase report")]
    for line in [first, *more]:
        shown.append(modalbase_here(*shlex.split(line)[1:], cwd=folder, code=0, **ours).stdout)
    found = {
        line.split("--")[0].removeprefix("modalbase ").strip(): out
        for line, out in zip([first, *more], shown, strict=True)
    }
    # what makes something makes it once
    make = MAKE if request.param else MAKE - {"import", "coupons"}
    for line in [first, *(line for line in more if line.split()[1] in make)]:
        modalbase_here(*shlex.split(line)[1:], cwd=folder, code=0, **ours)
    assert len(api.get("projects").json()["items"]) == 1 + request.param
    assert (folder / "frf.pdf").read_bytes().startswith(b"%PDF")
    assert "*ELASTIC, TYPE=ENGINEERING CONSTANTS" in (folder / "beam.inp").read_text()
    return found


def test_the_commands_of_the_tutorial_find_the_truth(printed: dict[str, str]) -> None:
    """A newcomer's first hour, as the page has it."""
    assert re.findall(r"^ *(\d+) +[\d.]+ ", printed["modes March"], flags=re.MULTILINE)[-1] == "5"
    result = json.loads(printed["result"])
    assert result["provenance"]["recipe"]["band_hz"] == [10.0, 1000.0]
    for row in result["parameters"]:
        if row["name"] in TRUTH:
            low, high = row["interval_95"]
            assert low <= TRUTH[row["name"]] <= high, row
    assert not next(row for row in result["parameters"] if row["name"] == "Ey")["identifiable"]
    assert len(re.findall(r"^ *C\d ", printed['coupons "0 degrees"'], flags=re.MULTILINE)) == 5
    (bad,) = re.findall(r"^ *(\d+) +(\d) +no ", printed["hits hits.npz"], flags=re.MULTILINE)
    assert bad == ("9", "2")
    assert printed['frfs "March, hits"'].startswith("2 FRFs")


def test_the_recipe_on_the_page_is_the_file() -> None:
    (shown,) = blocks("json")
    assert (
        json.loads(shown) == json.loads((FILES / "recipe.json").read_text()) == make_tutorial.RECIPE
    )


def test_the_script_makes_the_files(tmp_path: Path) -> None:
    """To the round-off of single precision: another machine's linear algebra differs in the last
    digits.
    """
    make_tutorial.make(tmp_path)
    assert sorted(one.name for one in tmp_path.iterdir()) == sorted(
        one.name for one in FILES.iterdir()
    )
    made, shipped = (
        [item for item in read_file(one / "beam.uff") if isinstance(item, Frf)]
        for one in (tmp_path, FILES)
    )
    assert len(made) == len(shipped) == 16
    for one, other in zip(made, shipped, strict=True):
        np.testing.assert_allclose(
            one.values, other.values, rtol=0, atol=1e-3 * np.abs(other.values).max()
        )
    assert (tmp_path / "C3.csv").read_text() == (FILES / "C3.csv").read_text()


# --- the README's script and the notebook's run as they stand in a clone, one after the other
# ---------------------------------------------------------------------------

(SCRIPT,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
NOTEBOOK = (ROOT / "examples" / "notebook.py").read_text()


@pytest.fixture
def run(
    service: LocalService,
    api: httpx.Client,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> Callable[[str], list[str]]:
    """Runs a script in the clone, and gives the lines that it prints."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("MODALBASE_URL", service.url)
    monkeypatch.setenv("MODALBASE_API_KEY", api.headers["authorization"].split()[1])

    def lines(script: str) -> list[str]:
        names: dict[str, object] = {}
        exec(compile(script, "README.md", "exec"), names)
        names["lab"].connection.close()
        return capsys.readouterr().out.splitlines()

    return lines


@pytest.mark.long
def test_the_scripts_of_readme_and_notebook_update_a_beam(
    run: Callable[[str], list[str]], api: httpx.Client
) -> None:
    """What the first one made the second one finds. The short form is the next test."""
    assert len(SCRIPT.strip().splitlines()) <= 15
    lines = run(SCRIPT)
    assert lines[0].split(":")[0] in ("usable", "with care", "do not use")
    assert any(line.startswith("warning: ") for line in lines)
    names = [line.split()[0] for line in lines[-7:]]
    assert names == ["Ex", "Ey", "Gxy", "Gxz", "Gyz", "a0", "a1"]
    assert len([line for line in NOTEBOOK.splitlines()[1:] if line.strip()]) <= 10
    assert any(re.match("Ex +GPa", line) for line in run(NOTEBOOK))
    (project,) = api.get("projects").json()["items"]
    (beam,) = api.get(f"projects/{project['id']}/structures").json()["items"]
    (march,) = api.get(f"structures/{beam['id']}/campaigns").json()["items"]
    assert len(api.get(f"campaigns/{march['id']}/imports").json()["items"]) == 1


def test_it_says_in_a_line_why_a_job_failed(run: Callable[[str], list[str]]) -> None:
    (line,) = run(SCRIPT.replace('campaign.import_file("examples/tutorial/beam.uff")\n', ""))
    assert line.startswith("update failed: ")
    assert "has no FRFs" in line


# --- the README's picture is what the code draws
# ------------------------------------------------------------------------

DRAWN = ROOT / "docs/images/beam.svg"


@pytest.mark.long
def test_the_pictures_updated_model_lies_on_the_measurement(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The test below is the short form: it updates the same beam."""
    from examples import picture  # loads matplotlib

    frfs = picture.prediction()
    peak = np.abs(frfs.measured).max(axis=1, keepdims=True)
    # 1 % noise of each record's rms is 0.5 % of its peak at the most; the initial model is off by a
    # resonance's width.
    assert np.abs((frfs.updated - frfs.measured) / peak).max() < 0.03
    assert np.abs((frfs.initial - frfs.measured) / peak).max() > 0.5
    monkeypatch.setattr(picture, "prediction", lambda: frfs)
    picture.main(str(tmp_path / "beam.svg"))
    again = (tmp_path / "beam.svg").read_text()
    assert again.count("<path") == DRAWN.read_text().count("<path")
    for text in (again, DRAWN.read_text()):
        assert all(color.lower() in text.lower() for _, color, *_ in picture.CURVES)


def test_an_update_without_the_service(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["core.py"])
    run_path("examples/core.py", run_name="__main__")
    shown = capsys.readouterr()
    found = dict(re.findall(r"^(\w+) +([\d.e+-]+) ", shown.out, flags=re.MULTILINE))
    assert float(found["Ex"]) == pytest.approx(31.66e9, rel=0.005)  # Table 4; the project's targets
    assert float(found["Gxy"]) == pytest.approx(6.30e9, rel=0.02)
    assert "Ey" not in found  # fixed
    assert len(re.findall(r"^mode \d", shown.out, flags=re.MULTILINE)) == 5
    assert "mode 3 (torsion): 399.28 Hz" in shown.out
    assert "held-out points (5, 17, 29)" in shown.out
    assert "rayleigh law is inadequate" in shown.out
    assert "100 % done" in shown.err


# --- the demonstration's file and the README's commands
# -----------------------------------------------------------------


def test_the_script_makes_the_demonstrations_file(tmp_path: Path) -> None:
    """The file in the package is what the script writes, to single precision's round-off."""
    made = tmp_path / "made.uff"
    with patch.object(sys, "argv", ["make_paper_beam.py", str(made)]):
        run_path(str(ROOT / "examples/make_paper_beam.py"), run_name="__main__")
    ours, shipped = (
        list(read_file(file)) for file in (made, ROOT / "service/pages/static/paper_beam.uff")
    )
    points = [[item for item in file if isinstance(item, GridPoint)] for file in (ours, shipped)]
    assert points[0] == points[1]
    assert len(points[0]) == 33
    frfs = [[item for item in file if isinstance(item, Frf)] for file in (ours, shipped)]
    assert len(frfs[0]) == len(frfs[1]) == 33
    for one, other in zip(*frfs, strict=True):
        assert (one.response_point, one.reference_point) == (
            other.response_point,
            other.reference_point,
        )
        # A hundredth of the noise in the file: shapes of its uppermost modes are good to some 1e-5.
        np.testing.assert_allclose(
            one.values, other.values, rtol=0, atol=1e-4 * np.abs(other.values).max()
        )


def test_readme_names_commands_that_exist() -> None:
    readme = (ROOT / "README.md").read_text()
    rules = re.findall(r"^([\w ]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    targets = {target for rule in rules for target in rule.split()}
    named = set(re.findall(r"`?make (\w+)`?", readme))
    assert {"demo", "test"} <= named <= targets
    subcommands = set(re.findall(r"modalbase (up|demo|keys|worker|serve|db|import)\b", readme))
    shown = modalbase_here("--help", code=0).stdout
    assert subcommands
    assert all(command in shown for command in subcommands)
