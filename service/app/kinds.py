"""Where the features come together for the worker: their kinds of job, without routes, whose making takes long at a start.

A new feature adds its kinds here and nowhere else.
"""

from __future__ import annotations

from service.jobs.kinds import JobKind
from service.monitoring.judgements import JUDGE
from service.store.forecasts.operations import FORECAST
from service.store.imports.operations import IMPORT
from service.store.modes.identifications import IDENTIFY
from service.store.records.processings import PROCESS
from service.store.structures.models import MODEL
from service.store.updating.operations import JOINT_UPDATE, UPDATE

KINDS: tuple[JobKind, ...] = (IMPORT, MODEL, PROCESS, IDENTIFY, FORECAST, UPDATE, JOINT_UPDATE, JUDGE)
"""Every kind of job that a worker can run."""
