"""Where the features come together for the worker: their kinds of job, without routes, whose making takes long at a start.

A new feature adds its kinds here and nowhere else.
"""

from __future__ import annotations

from service.imports.operations import IMPORT
from service.jobs.kinds import JobKind
from service.modes.identifications import IDENTIFY
from service.monitoring.judgements import JUDGE
from service.records.processings import PROCESS
from service.updating.joint_operations import JOINT_UPDATE
from service.updating.operations import UPDATE

KINDS: tuple[JobKind, ...] = (IMPORT, PROCESS, IDENTIFY, UPDATE, JOINT_UPDATE, JUDGE)
"""Every kind of job that a worker can run."""
