"""Every kind of job that has a folder is whole: listed, light where it computes, documented."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from service import tasks
from service.platform.queue.kinds import JobKind
from service.tasks.kinds import DECLARED, KINDS, TASKS
from service.tasks.routes import ROUTES
from service.tasks.task import BareTask, Ordered, Task

ROOT = Path(__file__).parents[3]
FOLDERS = sorted(path.parent.name for path in Path(tasks.__path__[0]).glob("*/__init__.py"))
ANSWERED = {"look", "plan"}  # are computed while their requests wait
HEAVY = ("fastapi", "starlette", "pydantic", "sqlalchemy", "psycopg", "procrastinate", "httpx")
ALL = pytest.mark.parametrize("task", TASKS, ids=lambda task: task.kind)


def test_every_folder_declares_its_task() -> None:
    kinds = {
        name: each if isinstance(each, JobKind) else each.noun.kind
        for name, each in DECLARED.items()
    }
    assert set(kinds.values()) == set(KINDS)
    assert set(FOLDERS) - kinds.keys() == ANSWERED
    for folder in kinds:
        home = f"{tasks.__name__}.{folder}.compute"
        assert kinds[folder].compute.__module__ == home, f"{folder} computes elsewhere"


def test_what_a_child_computes_loads_neither_database_nor_web() -> None:
    """One after the other in one process."""
    script = "import sys\n" + "".join(
        f"import service.tasks.{folder}.compute\n"
        f"assert not (heavy := set({HEAVY}) & set(sys.modules)), ({folder!r}, heavy)\n"
        for folder in FOLDERS
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@ALL
def test_a_task_declares_what_it_computes_and_keeps(task: BareTask) -> None:
    if not isinstance(task, Task):
        assert find_spec(f"{task.folder}.routes"), f"{task.kind} has no routes"
        return
    assert issubclass(task.noun.find.table, Ordered), f"{task.kind}'s table is no table of jobs"
    assert "found" in task.answer.model_fields, f"{task.kind}'s answer has no `found`"
    assert task.card.template != "task.html" or task.card.columns, f"{task.kind} shows no columns"
    assert task in ROUTES


@ALL
def test_the_documents_name_a_task(task: BareTask) -> None:
    address = f"/{task.noun.address}"
    documents = [
        path.name for path in (ROOT / "docs").glob("*.md") if path.name != "reference-rest.md"
    ]
    assert any(address in (ROOT / "docs" / name).read_text() for name in documents), (
        f"no document names {address}"
    )
    glossary = (ROOT / "docs/glossary.md").read_text().casefold()
    assert task.kind in glossary, f"docs/glossary.md has no entry of {task.kind}"
