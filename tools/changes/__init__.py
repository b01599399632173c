"""What a typical change costs: ten real ones, each a patch, made in a copy of the project.

`python -m tools.changes` makes each of them, or those that are named, lists the files that it
touches, writes the generated files anew, and runs the test that the patch brings: it shows the new
thing where users meet it. `--table` writes the table of `CONTRIBUTING.md`. A patch that no longer
applies is made anew: `git apply --3way`, mend, `git diff -U1`.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[2]
CONTRIBUTING = ROOT / "CONTRIBUTING.md"
PRODUCT = ("fecore/", "modalbase/", "service/")
GENERATED = (
    *(
        "modalbase/client/routes.json",
        "modalbase/client/fields.json",
        "modalbase/client/units.json",
    ),
    *("docs/reference-rest.md", "docs/reference-cli.md", "docs/database.md", "docs/findings.md"),
)
"""What `python -m tools.reference` writes; a test fails where it is stale."""

FILES = 3
"""Most files of the product that a typical change may touch."""

_TARGET = re.compile(r"^\+\+\+ b/(.+)$", re.MULTILINE)
_BEGIN, _END = "<!-- made by python -m tools.changes --table -->\n", "<!-- end -->\n"


@dataclass(frozen=True)
class Change:
    """A typical change.

    Attributes:
        name: of its patch, `tools/changes/NAME.patch`.
        what: what is added, in words.
        where: what to write, and where, for the table of `CONTRIBUTING.md`.
        check: what fails, and names it, where a place is forgotten.
    """

    name: str
    what: str
    where: str
    check: str

    @property
    def patch(self) -> Path:
        """Its patch."""
        return Path(__file__).with_name(f"{self.name}.patch")

    @cached_property
    def files(self) -> list[str]:
        """Files that the patch touches, but for generated ones."""
        targets = _TARGET.findall(self.patch.read_text(encoding="utf-8"))
        return [name for name in targets if name not in GENERATED]

    @property
    def product(self) -> list[str]:
        """Files of the product among them."""
        return [name for name in self.files if name.startswith(PRODUCT)]

    @property
    def tests(self) -> list[str]:
        """Tests among them, which show what is new."""
        return [name for name in self.files if re.fullmatch(r"tests/.*test_\w+\.py", name)]


CHANGES: tuple[Change, ...] = (
    Change(
        "finding",
        "a finding of an update",
        "a row in `fecore/updating/known_findings.py`: level, sentence, advice, where it is mended;"
        " `finding(…)` where the condition is looked at",
        "`tests/unit/test_findings.py`: a row that is not used, lacks a value, or leads nowhere; its line"
        " in [all findings](docs/findings.md), which is made",
    ),
    Change(
        "criterion",
        "a correlation criterion",
        "a function and its row of `CRITERIA` in `fecore/correlation.py`; its name in"
        " `fecore/__init__.py`",
        "`tests/unit/fecore/test_correlation.py`: its figure in [figures](docs/figures.md), its"
        " member in [results](docs/results.md), its term in the glossary",
    ),
    Change(
        "column",
        "a column of the search",
        "a `Field` of its noun in `service/nouns/search/nouns.py`",
        "`tests/unit/test_docs.py`: its name in [search](docs/search.md)",
    ),
    Change(
        "law",
        "a damping law",
        "a row in `fecore/dynamics/laws.py`, and a class in `damping_laws.py` where no form fits",
        "`tests/unit/fecore/test_laws.py`: its sentence in [theory](docs/theory.md), its name in"
        " [updating](docs/updating.md)",
    ),
    Change(
        "parameter",
        "a kind of parameter",
        "a row in `fecore/quantities.py`, and `nominal` and `row` of the body that has it",
        "`tests/unit/fecore/test_quantities.py`",
    ),
    Change(
        "format",
        "a format of FRFs",
        "a module in `modalbase/formats/frfs`, path to `Frfs` and back; its row in"
        " `modalbase/formats/registry.py`",
        "`tests/unit/formats/test_registry.py`; the file is cut at every length",
    ),
    Change(
        "channel",
        "a channel of alarms",
        "a module in `service/nouns/notifications/channels` with `check`, `send` and its"
        " `Channel`, named in `CHANNELS` there",
        "`tests/unit/service/test_channels.py`: one that is not listed, a member without its row in"
        " [monitoring](docs/monitoring.md)",
    ),
    Change(
        "job",
        "a kind of job",
        "a folder in `service/tasks`: `compute.py`, `task.py` with `TASK`, `routes.py`; a migration",
        "`tests/unit/service/test_tasks.py`: what is missing, its name in the glossary; `test_db.py`"
        " compares the table",
    ),
    Change(
        "field",
        "a condition of a campaign",
        "a member of `Climate` in `service/nouns/campaigns/climate.py`, and a migration; `python -m tools.reference`",
        "`tests/unit/service/test_climate.py`; `test_db.py` compares the table, `test_members.py`"
        " wants a value of it",
    ),
    Change(
        "element",
        "a finite element",
        "a class in its family's file of `fecore/body/elements`, and its row in"
        " `modalbase/formats/cell_types.py`: nodes, and its names in the files that have it",
        "`tests/unit/formats/test_cell_types.py`; rigid motions, a closed form and the order of"
        " convergence are tested beside it",
    ),
)


def applies(change: Change, tree: Path = ROOT) -> str:
    """Why the patch does not fit a tree, in the words of `git apply`; empty where it does."""
    return _apply(change, tree, "--check").stderr.strip()


@contextmanager
def changed(change: Change) -> Iterator[Path]:
    """A copy of the project with a change and what is generated of it, while the block runs.

    Raises:
        RuntimeError: the patch does not fit, or the generated files cannot be written.
    """
    with TemporaryDirectory(prefix="change-") as folder:
        tree = Path(folder)
        listed = _run(["git", "ls-files", "-z"], ROOT)
        for name in filter(None, listed.stdout.split("\0")):
            if (ROOT / name).is_file() or (ROOT / name).is_symlink():
                (tree / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, tree / name, follow_symlinks=False)
        for made in (_apply(change, tree), _run([sys.executable, "-m", "tools.reference"], tree)):
            if made.returncode:
                raise RuntimeError(f"{change.name}: {made.stdout}{made.stderr}")
        yield tree


def show(change: Change) -> bool:
    """Make a change, print what it touches, and run its tests: did they pass?"""
    print(f"{change.what}: {len(change.product)} files of the product")
    for name in change.files:
        print(f"  {name}")
    with changed(change) as tree:
        tested = _run([sys.executable, "-m", "pytest", "-q", *change.tests], tree)
    print(
        "  "
        + "\n  ".join(tested.stdout.strip().split("\n")[-1 if not tested.returncode else -30 :])
    )
    return not tested.returncode


def table() -> str:
    """The table of `CONTRIBUTING.md`."""
    rows = [
        f"| {one.what} | {one.where} | {len(one.product)} | {one.check} |"
        for one in sorted(CHANGES, key=lambda one: one.what)
    ]
    head = ["| what | where | files | what fails where a place is forgotten |", "|---|---|---|---|"]
    return "\n".join([*head, *rows]) + "\n"


def contributing() -> str:
    """`CONTRIBUTING.md` with the table as it should be."""
    text = CONTRIBUTING.read_text(encoding="utf-8")
    before, rest = text.split(_BEGIN)
    return before + _BEGIN + table() + _END + rest.split(_END, 1)[1]


def _apply(change: Change, tree: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return _run(["git", "apply", *options, str(change.patch)], tree)


def _run(command: Sequence[str], tree: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a tree, with the tree's packages before installed ones."""
    path = os.pathsep.join(filter(None, [str(tree), os.environ.get("PYTHONPATH")]))
    around = {**os.environ, "PYTHONPATH": path, "GIT_CEILING_DIRECTORIES": str(tree.parent)}
    if tree == ROOT:
        del around["GIT_CEILING_DIRECTORIES"]
    return subprocess.run(
        command, cwd=tree, env=around, capture_output=True, text=True, check=False
    )
