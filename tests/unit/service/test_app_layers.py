"""The import contracts hold, and they catch what they are there for."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.places import ROOT


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for package in ("fecore", "modalbase", "service", "migrations", "tools"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_contracts_hold() -> None:
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout


# A file, an import that is forbidden there, and the beginning of the contract's name.
FAULTS = (
    ("fecore/body/mesh.py", "import sqlalchemy", "fecore: pure"),
    ("fecore/body/mesh.py", "import service.settings", "fecore: pure"),
    ("fecore/body/laminate.py", "import fecore.body.model", "fecore.body:"),
    ("fecore/body/laminate.py", "import fecore.dynamics.eigen", "fecore: data flows one way"),
    ("fecore/dynamics/eigen.py", "import fecore.dynamics.reduction", "fecore.dynamics:"),
    ("fecore/correlation.py", "import fecore.modal", "fecore: data flows one way"),
    ("service/db/engine.py", "import service.access.tables", "service: imports run downwards only"),
    (
        "service/store/structures/schemas.py",
        "import service.store.campaigns.schemas",
        "service.store: a noun needs only",
    ),
    ("service/show/figures/marks.py", "import service.show.pages", "service.show: imports run downwards only"),
    ("service/app/doctor.py", "import service.app.supervisor", "service.app: imports run downwards only"),
    ("service/jobs/child.py", "import service.app.application", "service: imports run downwards only"),
    ("service/monitoring/runs.py", "from service.store.modes.operations import ModeSet", "tables: only"),
    ("service/store/frfs/data.py", "from service.store.structures.operations import Structure", "tables: only"),
    ("service/store/campaigns/schemas.py", "import service.store.frfs.schemas", "service.store: a noun needs only"),
    ("modalbase/client/jobs.py", "import service.settings", "modalbase: what a user imports"),
    ("modalbase/client/jobs.py", "import numpy", "modalbase.client: HTTP alone"),
    ("modalbase/formats/uff/scan.py", "import fecore.errors", "modalbase: what a user imports"),
    ("modalbase/formats/uff/scan.py", "import httpx", "modalbase.formats: bytes to dataclasses"),
    ("fecore/mesh.py", "import modalbase", "fecore: pure"),
    ("service/compute/updating.py", "import sqlalchemy", "computations: neither database nor web"),
)


def test_contracts_catch_each_fault(copy: Path) -> None:
    for file, fault, _ in FAULTS:
        with (copy / file).open("a") as target:
            target.write(f"\n{fault}\n")
    done = lint(copy)
    assert done.returncode == 1
    headed = re.split(r"^(.+)\n-+\n", done.stdout.partition("Broken contracts")[2], flags=re.MULTILINE)
    found = dict(zip(headed[1::2], headed[2::2], strict=True))
    for file, fault, contract in FAULTS:
        imported = fault.removeprefix("from ").replace(" import ", ".").removeprefix("import ")
        edge = f"{file.removesuffix('.py').replace('/', '.')} -> {imported}"
        (broken,) = (text for name, text in found.items() if name.startswith(contract))
        assert f"{edge} (l." in " ".join(broken.split()), (edge, broken)  # lines are wrapped


def test_the_service_starts_without_what_only_some_jobs_need() -> None:
    """Each takes a good part of a second to import, in every process that starts."""
    parts = ("linalg", "optimize", "sparse", "special", "stats")
    heavy = (*(f"scipy.{part}" for part in parts), "alembic", "emcee", "h5py", "markdown_it", "matplotlib")
    worker, web = "service.jobs.worker, service.app.kinds, service.monitoring.scheduler", ("fastapi", "starlette")
    script = (
        f"import sys, {worker}; print([m for m in {web} if m in sys.modules])\n"
        f"import service.app.application; print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]", "[]"]
