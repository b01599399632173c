"""Where all kinds of job come together, without routes, whose making takes long at a start.

A new kind is a folder beside this file, and nothing else.
"""

from importlib import import_module
from importlib.util import find_spec
from pkgutil import iter_modules

from service import tasks
from service.platform.queue.kinds import JobKind
from service.tasks.task import BareTask

DECLARED: dict[str, BareTask | JobKind] = {
    folder.name: import_module(f"{tasks.__name__}.{folder.name}.task").TASK
    for folder in iter_modules(tasks.__path__)
    if folder.ispkg and find_spec(f"{tasks.__name__}.{folder.name}.task") is not None
}
"""What each folder declares, by its name; a kind of job alone where nobody asks for one by REST."""

TASKS = tuple(each for each in DECLARED.values() if isinstance(each, BareTask))
"""Kinds that REST knows."""

KINDS: tuple[JobKind, ...] = tuple(
    each.noun.kind if isinstance(each, BareTask) else each for each in DECLARED.values()
)
"""Every kind of job that a worker can run."""
