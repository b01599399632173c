"""Where all kinds of job come together, without routes, whose making takes long at a start.

A new kind is a folder beside this file, and nothing else.
"""

from importlib import import_module
from pkgutil import iter_modules

from service import tasks
from service.monitoring.judgements import JUDGE
from service.nouns.updating.operations import UPDATES
from service.platform.queue.kinds import JobKind
from service.tasks.task import BareTask

TASKS: tuple[BareTask, ...] = tuple(
    import_module(f"{tasks.__name__}.{folder.name}.task").TASK
    for folder in iter_modules(tasks.__path__)
    if folder.ispkg
)
"""Kinds that declare all of themselves in one folder, by the names of the folders."""

_NOUNS = (UPDATES,)
KINDS: tuple[JobKind, ...] = (*(task.noun.kind for task in TASKS), *(n.kind for n in _NOUNS), JUDGE)
"""Every kind of job that a worker can run."""
