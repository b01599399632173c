"""The tutorial: its files are what its script makes; from the wheel alone, in an empty folder, its commands find the truth."""

import json
import re
import shlex
import shutil
import sys
from pathlib import Path

import httpx
import numpy as np
import pytest

from examples import make_tutorial
from modalbase.formats.uff import Frf, read_file
from service.app.supervisor import LocalService
from tests.support.command import modalbase_here, run_as_typed
from tests.support.places import ROOT

PAGE = (ROOT / "docs" / "tutorial.md").read_text()
FILES = ROOT / "examples" / "tutorial"
COMMANDS = """
import json, shlex, sys
import service
from tests.support.command import modalbase_here
around, lines = json.load(sys.stdin)
assert service.__file__.startswith(around["PYTHONPATH"].split(":")[0]), service.__file__
print(json.dumps([modalbase_here(*shlex.split(line)[1:], code=0, **around).stdout for line in lines]))
"""
TRUTH = {
    **{name: getattr(make_tutorial.TRUTH, name) for name in ("Ex", "Ey", "Gxy", "Gxz")},
    "a0": make_tutorial.A0,
    "a1": make_tutorial.A1,
}


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)


@pytest.fixture
def printed(service: LocalService, api: httpx.Client, unpacked: Path, tmp_path: Path) -> dict[str, str]:
    """What each command of the page prints, in a folder with the shipped files alone."""
    folder = tmp_path / "beam"
    shutil.copytree(FILES, folder)
    ours = {
        "MODALBASE_URL": service.url,
        "MODALBASE_API_KEY": api.headers["authorization"].split()[1],
        "COLUMNS": "200",
        "PYTHONPATH": f"{unpacked}:{ROOT}",  # of this tree nothing but the tests: the wheel's packages come first
    }
    first, *others = blocks("sh")
    lines = first.splitlines()
    shown = [
        run_as_typed(line, folder, **ours) for line in lines
    ]  # as a shell does; the others in one process, as each imports for a while
    more = "".join(others).splitlines()
    shown += json.loads(run_as_typed([sys.executable, "-c", COMMANDS], folder, json.dumps([ours, more]), **ours))
    found = {
        line.split("--")[0].removeprefix("modalbase ").strip(): out
        for line, out in zip(lines + more, shown, strict=True)
    }
    again = [
        line for line in more if line.split()[1] not in ("modes", "update", "hits")
    ]  # jobs, and one more of each hit
    for line in [*lines, *again]:
        modalbase_here(*shlex.split(line)[1:], cwd=folder, code=0, **ours)
    assert len(api.get("projects").json()["items"]) == 1
    assert (folder / "frf.pdf").read_bytes().startswith(b"%PDF")
    assert "*ELASTIC, TYPE=ENGINEERING CONSTANTS" in (folder / "beam.inp").read_text()
    return found


def test_the_commands_of_the_tutorial_find_the_truth(printed: dict[str, str]) -> None:
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
    assert json.loads(shown) == json.loads((FILES / "recipe.json").read_text()) == make_tutorial.RECIPE


def test_the_script_makes_the_files(tmp_path: Path) -> None:
    """To the round-off of single precision: another machine's linear algebra differs in the last digits."""
    make_tutorial.make(tmp_path)
    assert sorted(one.name for one in tmp_path.iterdir()) == sorted(one.name for one in FILES.iterdir())
    made, shipped = (
        [item for item in read_file(one / "beam.uff") if isinstance(item, Frf)] for one in (tmp_path, FILES)
    )
    assert len(made) == len(shipped) == 16
    for one, other in zip(made, shipped, strict=True):
        np.testing.assert_allclose(one.values, other.values, rtol=0, atol=1e-3 * np.abs(other.values).max())
    assert (tmp_path / "C3.csv").read_text() == (FILES / "C3.csv").read_text()
