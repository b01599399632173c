"""`modalbase demo` and the README's commands."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from modalbase.formats.uff import Frf, GridPoint, read_file
from tests.support.command import modalbase
from tests.support.places import ROOT
from tests.support.waiting import until

POISON = """import os
open(os.environ["POISONED"], "a").write(__name__ + "\\n")
raise ImportError("this is a laboratory's own file")
"""


def test_demo_prints_the_result_alone_and_leaves_nothing_running(tmp_path: Path) -> None:
    """In a laboratory's own folder: its `signal.py` is no reason to stop, its `service.py` nothing to run, in no process."""
    mark = f"demo-test-{os.getpid()}"
    folder, poisoned = tmp_path / "laboratory", tmp_path / "poisoned"
    folder.mkdir()
    for name in ("signal", "service", "numpy", "json", "fecore", "modalbase", "multiprocessing", "migrations"):
        (folder / f"{name}.py").write_text(POISON)
    around = {"MODALBASE_TEST_MARK": mark, "HOME": str(tmp_path), "POISONED": str(poisoned)}
    ended = modalbase("demo", "--json", cwd=folder, **around)
    assert ended.returncode == 0, ended.stderr
    assert not poisoned.exists()
    result = json.loads(ended.stdout)  # the document and nothing else
    found = {row["name"]: row for row in result["parameters"]}
    assert found["Ex"]["estimate"] == pytest.approx(
        31.66e9, rel=0.005
    )  # the paper's; the target of docs/theory.md, section 10
    assert found["Gxy"]["estimate"] == pytest.approx(6.30e9, rel=0.02)
    assert not found["Ey"]["identifiable"]
    assert any("rayleigh" in warning for warning in result["warnings"])
    assert "The demonstration takes a cantilever" in ended.stderr
    assert "the paper's own measured damping, not its print" in " ".join(ended.stderr.split())
    assert "next: modalbase up" in ended.stderr
    until(lambda: not _processes_with(mark), "the end of all that it started", lambda: _processes_with(mark))


def _processes_with(mark: str) -> list[str]:
    """Processes whose environment carries the mark: whatever the demonstration started and did not end."""
    left = []
    for process in Path("/proc").iterdir():
        if process.name.isdigit() and int(process.name) != os.getpid():
            try:
                if mark.encode() in (process / "environ").read_bytes():
                    left.append((process / "cmdline").read_text())
            except OSError:
                continue  # it ended meanwhile, or is not ours
    return left


def test_the_script_makes_the_demonstrations_file(tmp_path: Path) -> None:
    """The file in the package is what the script writes, to single precision's round-off."""
    made = tmp_path / "made.uff"
    subprocess.run([sys.executable, str(ROOT / "examples/make_paper_beam.py"), str(made)], check=True, cwd=ROOT)
    ours, shipped = (list(read_file(file)) for file in (made, ROOT / "service/demo/paper_beam.uff"))
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
