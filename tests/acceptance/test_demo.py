"""The demonstration's file and the README's commands; the demonstration itself runs in `test_packages.py`."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np

from modalbase.formats.uff import Frf, GridPoint, read_file
from tests.support.places import ROOT


def test_the_script_makes_the_demonstrations_file(tmp_path: Path) -> None:
    """The file in the package is what the script writes, to single precision's round-off."""
    made = tmp_path / "made.uff"
    subprocess.run([sys.executable, str(ROOT / "examples/make_paper_beam.py"), str(made)], check=True, cwd=ROOT)
    ours, shipped = (list(read_file(file)) for file in (made, ROOT / "service/app/demo/paper_beam.uff"))
    points = [[item for item in file if isinstance(item, GridPoint)] for file in (ours, shipped)]
    assert points[0] == points[1]
    assert len(points[0]) == 33
    frfs = [[item for item in file if isinstance(item, Frf)] for file in (ours, shipped)]
    assert len(frfs[0]) == len(frfs[1]) == 33
    for one, other in zip(*frfs, strict=True):
        assert (one.response_point, one.reference_point) == (other.response_point, other.reference_point)
        # A hundredth of the noise in the file: shapes of its uppermost modes are good to some 1e-5.
        np.testing.assert_allclose(one.values, other.values, rtol=0, atol=1e-4 * np.abs(other.values).max())


def test_readme_names_commands_that_exist() -> None:
    readme = (ROOT / "README.md").read_text()
    rules = re.findall(r"^([\w ]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    targets = {target for rule in rules for target in rule.split()}
    named = set(re.findall(r"`?make (\w+)`?", readme))
    assert {"demo", "test"} <= named <= targets
    subcommands = set(re.findall(r"modalbase (up|demo|keys|worker|serve|db|import)\b", readme))
    shown = subprocess.run([sys.executable, "-m", "service", "--help"], capture_output=True, text=True, check=True)
    assert subcommands
    assert all(command in shown.stdout for command in subcommands)
