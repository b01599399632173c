"""The code as a reader and a user find it: calls, words, examples, exported names, what is made
from it, its contracts.
"""

import ast
import doctest
import importlib
import itertools
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

import fecore
import modalbase
from modalbase.client.connection import Connection
from modalbase.client.rest import Rest
from modalbase.client.rest import routes as calls
from tests.support.places import ROOT, parsed
from tools import reference

PACKAGES = ("fecore", "modalbase", "service")


# --- code, messages and documents use the glossary's words
# --------------------------------------------------------------

PRIVATE = re.compile(
    r"\b(tell|tells|told|telling|keepers?|postman|stewards?|rungs?|climb(s|ed|ing)?|disown(s|ed)?|what"
    r" of it)\b"
    r"(?!\(\))",  # `file.tell()` is Python's
    re.IGNORECASE,
)
PLACES = (
    *("fecore", "modalbase", "service", "migrations", "tests", "benchmarks", "examples"),
    *("docs", "README.md", "CHANGELOG.md", "SECURITY.md"),
)


def lines_with(word: re.Pattern[str], place: str, *kinds: str) -> list[str]:
    """Lines of the files in a place, or of that file, that hold such a word; of this file none."""
    top = ROOT / place
    return [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in ([top] if top.is_file() else sorted(top.rglob("*")))
        if path.suffix in kinds and path != Path(__file__)
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        if word.search(line)
    ]


@pytest.mark.parametrize("place", PLACES)
def test_the_words_are_the_glossarys(place: str) -> None:
    assert lines_with(PRIVATE, place, ".py", ".md") == []


# --- tests wait for events: a sleep, or a time that is measured, stands in no test
# --------------------------------------

TIME = re.compile(r"(?<!def )\b(sleep|monotonic|perf_counter|process_time|time\.time)\((?!0\))")
"""`sleep(0)` lets others run, and a `def` is a clock of the test's own."""
CLOCKS = (
    "waiting.py",  # looks again and again
    "computations.py",  # a job that is held
    "receivers.py",  # a signature must be fresh
    "watching.py",  # benchmarks print what the health check took
    "heavy_load.py",  # they print what answers took
    "kills.py",  # kills come at random moments
)


def test_no_test_knows_a_clock() -> None:
    found = lines_with(TIME, "tests", ".py")
    assert [
        line
        for line in found
        if not line.startswith(tuple(f"tests/support/{name}:" for name in CLOCKS))
    ] == []


# --- the examples in docstrings run and give what they show
# -------------------------------------------------------------

MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for package in PACKAGES
    for path in sorted(Path(ROOT / package).rglob("*.py"))
    if ">>> " in path.read_text()
]


def test_examples() -> None:
    ran = {module: doctest.testmod(importlib.import_module(module)) for module in MODULES}
    assert len(ran) > 20
    assert [module for module, (failed, tried) in ran.items() if failed or not tried] == []


# --- what `import fecore` and `import modalbase` give a user, named one by one
# ------------------------------------------

FECORE = """
    BeamSpecimen Dof Edge FecoreError ForwardModel FrfSet HoldOut Identification IdentificationError InputError
    MeasuredModes Measurement ModelError Options OrthotropicMaterial Parameter Ply PointMass Recipe Specimen Spring
    UpdateResult UpdatingError __version__ comac csac csf fdac frac homogenise identify mac sac section update
"""
MODALBASE = """
    ClientError FormatError Frfs JobFailed Laboratory UffError __version__ connect read_machine_csv read_uff write_uff
"""


@pytest.mark.parametrize(("package", "names"), [(fecore, FECORE), (modalbase, MODALBASE)])
def test_the_exported_members_are_these(package: ModuleType, names: str) -> None:
    assert sorted(package.__all__) == sorted(names.split())
    for name in package.__all__:
        assert getattr(package, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        _ = package.nonsense
    assert fecore.__version__ == modalbase.__version__


HEAVY = ("numpy", "scipy", "httpx", "sqlalchemy", "psycopg", "fastapi", "pydantic", "fecore")
SCIPY = tuple(f"scipy.{part}" for part in ("linalg", "optimize", "sparse", "special", "stats"))
HELP = f"""
import os
if child := os.fork():  # which alone loads what help needs
    assert os.waitpid(child, 0)[1] == 0
else:
    from click.testing import CliRunner; from typer.main import get_command
    from service.app.cli.command import app
    root = get_command(app)
    for names in ([], *([name] for name in root.commands)):
        assert CliRunner().invoke(root, [*names, "--help"]).exit_code == 0, names
    assert not (found := set({HEAVY}) & set(sys.modules)), found
    os._exit(0)
"""
LIGHT: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("import modalbase.commands.app", HEAVY),
    (HELP, HEAVY),
    ("import modalbase, modalbase.client.connection, modalbase.objects.laboratory", ("numpy",)),
    ("import modalbase.formats", ("fecore",)),
    ("import fecore", ("scipy",)),
    (
        "import service.platform.queue.worker, service.tasks.kinds, service.monitoring.scheduler",
        ("fastapi", "starlette"),
    ),
    (
        "import service.app.application",
        (*SCIPY, "alembic", "emcee", "h5py", "markdown_it", "matplotlib"),
    ),
)


def test_a_start_loads_no_more_than_it_needs() -> None:
    """Help, the library, a worker and the service, one after the other in one process, as each
    brings what the ones before it did: what is heavy takes a good part of a second in each that
    starts.
    """
    script = "import sys\n" + "".join(
        f"{start}\nassert not (found := set({without}) & set(sys.modules)), ({start!r}, found)\n"
        for start, without in LIGHT
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_commands_ask_objects_and_not_the_connection_beneath_them() -> None:
    beneath = {"connection", "rest"}
    calls_rest = [
        f"{path}:{node.lineno}"
        for path, tree in (*parsed("modalbase/commands").items(), *parsed("service/app").items())
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and node.attr in beneath
        and ast.unparse(node.value).endswith("lab")
    ]
    assert calls_rest == []


# --- what is made from code is what the code makes now
# ------------------------------------------------------------------


@pytest.mark.parametrize("name", list(reference.MADE))
def test_what_is_made_from_code_is_up_to_date(name: str) -> None:
    assert (reference.ROOT / name).read_text() == reference.MADE[name](), (
        "run python -m tools.reference"
    )


def of_numbers(value: ast.expr) -> bool:
    parts = list(ast.walk(value))
    leaves = [part.value for part in parts if isinstance(part, ast.Constant)]
    other = any(isinstance(part, ast.Call | ast.Subscript | ast.Attribute) for part in parts)
    return bool(leaves) and all(isinstance(leaf, int | float) for leaf in leaves) and not other


def test_every_number_that_the_core_decides_by_has_its_meaning_beside_it() -> None:
    """In a comment or docstring."""
    stated: dict[str, bool] = {}
    for path, tree in parsed("fecore").items():
        lines = path.read_text().splitlines()
        for node, after in itertools.zip_longest(tree.body, tree.body[1:]):
            target = (
                node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
            )
            if (
                isinstance(target, ast.Name)
                and re.fullmatch(r"_?[A-Z][A-Z0-9_]*", target.id)
                and of_numbers(node.value)
            ):
                own, above = lines[node.lineno - 1 : node.end_lineno], lines[node.lineno - 2]
                docstring = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
                stated[f"{path}: {target.id}"] = (
                    docstring or "#" in "".join(own) or above.startswith("#")
                )
    assert len(stated) > 100
    assert [name for name, meaning in stated.items() if not meaning] == []


def test_every_route_of_the_openapi_document_is_a_method_of_the_client() -> None:
    document = reference.document()
    asked = [
        given
        for path in document["paths"].values()
        for how in path.values()
        for given in how.get("parameters", ())
    ]
    limits = {given["schema"].get("default") for given in asked if given["name"] == "limit"}
    # 20 of what is long; 1000 of points of a series; None of grid points, which come all at once
    assert limits == {20, 100, 1000, None}
    found = {(one.method, one.path) for one in reference.described(document)}
    assert found == {(route.method, route.path) for route in calls().values()}
    assert len(found) == len(calls()) > 80
    with Connection("http://127.0.0.1:1", "key") as nobody:
        rest = Rest(nobody)
        for name, route in calls().items():
            assert route.summary in (getattr(rest, name).__doc__ or "")
        assert set(calls()) <= set(dir(rest))


def test_every_library_that_is_installed_has_its_licence_listed() -> None:
    project = tomllib.loads((reference.ROOT / "pyproject.toml").read_text())["project"]
    wanted = [
        *project["dependencies"],
        *(
            one
            for name in ("server", "mat73", "mdf", "tdms")
            for one in project["optional-dependencies"][name]
        ),
    ]
    page = (reference.ROOT / "docs" / "licences.md").read_text()
    assert re.findall(r"^- ([\w-]+): .+", page, flags=re.MULTILINE) == [
        re.split(r"[^\w-]", one)[0] for one in wanted
    ]


# --- the import contracts hold, and they catch what they are there for
# --------------------------------------------------


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for package in ("fecore", "modalbase", "service", "migrations", "tools"):
        shutil.copytree(
            ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


# A file, an import that is forbidden there, and the beginning of the contract's name.
FAULTS = (
    ("fecore/body/mesh.py", "import sqlalchemy", "fecore: pure"),
    ("fecore/body/mesh.py", "import service.platform.settings", "fecore: pure"),
    ("fecore/body/laminate.py", "import fecore.body.model", "fecore.body:"),
    ("fecore/body/laminate.py", "import fecore.dynamics.eigen", "fecore: data flows one way"),
    ("fecore/dynamics/eigen.py", "import fecore.dynamics.reduction", "fecore.dynamics:"),
    ("fecore/correlation.py", "import fecore.modal", "fecore: data flows one way"),
    ("service/platform/db/engine.py", "import service.platform.access.tables", "service.platform: imports run downwards only"),
    ("service/nouns/structures/schemas.py", "import service.nouns.campaigns.schemas",
     "service.nouns: a noun needs only"),
    ("service/figures/marks.py", "import service.pages", "service: imports run downwards only"),
    ("service/app/doctor.py", "import service.app.supervisor", "service.app: imports run downwards only"),
    ("service/platform/queue/child.py", "import service.app.application", "service: imports run downwards only"),
    ("service/monitoring/runs.py", "from service.nouns.monitors.tables import MonitorRun", "tables: only"),
    ("service/nouns/frfs/data.py", "from service.nouns.structures.operations import Structure", "tables: only"),
    ("service/nouns/campaigns/schemas.py", "import service.nouns.frfs.schemas", "service.nouns: a noun needs only"),
    ("modalbase/client/endpoint.py", "import service.platform.settings", "modalbase: what a user imports"),
    ("modalbase/client/endpoint.py", "import numpy", "modalbase.client: HTTP alone"),
    ("modalbase/client/endpoint.py", "import modalbase.objects.files", "modalbase: commands on objects"),
    ("modalbase/objects/thing.py", "import modalbase.commands.app", "modalbase: commands on objects"),
    ("modalbase/formats/uff/scan.py", "import modalbase.client.display", "modalbase: commands on objects"),
    ("modalbase/commands/updating.py", "import modalbase.client.connection", "REST: nothing but"),
    ("service/app/cli/people.py", "import modalbase.client.rest", "REST: nothing but"),
    ("modalbase/formats/uff/scan.py", "import fecore.errors", "modalbase: what a user imports"),
    ("modalbase/formats/uff/scan.py", "import httpx", "modalbase.formats: bytes to dataclasses"),
    ("fecore/mesh.py", "import modalbase", "fecore: pure"),
    ("service/compute/processing.py", "import sqlalchemy", "computations: neither database nor web"),
    ("service/tasks/forecast/compute.py", "import sqlalchemy", "computations: neither database nor web"),
)  # fmt: skip


@pytest.mark.long
def test_contracts_catch_each_fault(copy: Path) -> None:
    """In short `make check` has the contracts hold."""
    for file, fault, _ in FAULTS:
        with (copy / file).open("a") as target:
            target.write(f"\n{fault}\n")
    done = lint(copy)
    assert done.returncode == 1
    headed = re.split(
        r"^(.+)\n-+\n", done.stdout.partition("Broken contracts")[2], flags=re.MULTILINE
    )
    found = dict(zip(headed[1::2], headed[2::2], strict=True))
    for file, fault, contract in FAULTS:
        imported = fault.removeprefix("from ").replace(" import ", ".").removeprefix("import ")
        edge = f"{file.removesuffix('.py').replace('/', '.')} -> {imported}"
        (broken,) = (text for name, text in found.items() if name.startswith(contract))
        assert f"{edge} (l." in " ".join(broken.split()), (edge, broken)  # lines are wrapped


def test_a_package_names_its_modules_in_the_order_of_the_data() -> None:
    """The docstring of each package of some size is a map of it."""
    unnamed = []
    for package in ("fecore", "modalbase"):
        for init in sorted((ROOT / package).rglob("__init__.py")):
            rooms = {
                path.stem if path.is_file() else path.name
                for path in init.parent.iterdir()
                if (path.suffix == ".py" and not path.stem.startswith("__"))
                or (path / "__init__.py").exists()
            }
            said = set(re.findall(r"\w+", ast.get_docstring(ast.parse(init.read_text())) or ""))
            if len(rooms) > 3:
                unnamed += [f"{init.relative_to(ROOT)}: {name}" for name in sorted(rooms - said)]
    assert unnamed == []
