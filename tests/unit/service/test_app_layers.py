"""The import contracts hold, and they catch what they are there for."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.places import ROOT


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for package in ("fecore", "modalbase", "service", "migrations"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_contracts_hold(copy: Path) -> None:
    done = lint(copy)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("file", "fault", "contract"),
    [
        ("fecore/body/mesh.py", "import sqlalchemy", "fecore: pure"),
        ("fecore/body/mesh.py", "import service.settings", "fecore: pure"),
        ("fecore/body/laminate.py", "import fecore.body.model", "fecore.body"),
        ("fecore/body/laminate.py", "import fecore.dynamics.eigen", "fecore: data flows one way"),
        ("fecore/dynamics/eigen.py", "import fecore.dynamics.reduction", "fecore.dynamics"),
        ("fecore/correlation.py", "import fecore.identification", "fecore: data flows one way"),
        ("service/db/engine.py", "import service.access.tables", "service: imports run downwards only"),
        ("service/structures/tables.py", "import service.campaigns.tables", "service: imports run downwards only"),
        ("service/jobs/child.py", "import service.app", "service: imports run downwards only"),
        ("service/monitoring/values.py", "import service.modes.tables", "tables of modes"),
        ("service/frfs/measurement.py", "import service.structures.tables", "tables of structures"),
        ("service/campaigns/tables.py", "import service.frfs.tables", "service: imports run downwards only"),
        ("modalbase/client/jobs.py", "import service.settings", "modalbase: what a user imports"),
        ("modalbase/client/jobs.py", "import numpy", "modalbase.client: HTTP alone"),
        ("modalbase/formats/uff/scan.py", "import fecore.errors", "modalbase: what a user imports"),
        ("modalbase/formats/uff/scan.py", "import httpx", "modalbase.formats: bytes to dataclasses"),
        ("fecore/mesh.py", "import modalbase", "fecore: pure"),
    ],
)
def test_contracts_catch_a_fault(copy: Path, file: str, fault: str, contract: str) -> None:
    with (copy / file).open("a") as target:
        target.write(f"\n{fault}\n")
    done = lint(copy)
    assert done.returncode == 1
    broken = [line for line in done.stdout.splitlines() if line.endswith("BROKEN")]
    assert any(line.startswith(contract) for line in broken), done.stdout


def test_the_service_starts_without_what_only_some_jobs_need() -> None:
    """Each takes a good part of a second to import, in every process that starts."""
    heavy = ("scipy.linalg", "scipy.optimize", "scipy.special", "scipy.stats", "emcee", "matplotlib", "h5py")
    script = f"import sys, service.app, service.jobs.worker; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
