"""Where the features come together for the worker: their kinds of job, without routes, whose making
takes long at a start.

A new feature adds its kinds here and nowhere else.
"""

from service.jobs.kinds import JobKind
from service.monitoring.judgements import JUDGE
from service.store.forecasts.operations import FORECASTS
from service.store.imports.operations import IMPORTS
from service.store.modes.operations import IDENTIFICATIONS
from service.store.records.processings import PROCESSINGS
from service.store.structures.models import MODELS
from service.store.updating.operations import JOINT_UPDATES, UPDATES

_NOUNS = (IMPORTS, MODELS, PROCESSINGS, IDENTIFICATIONS, FORECASTS, UPDATES, JOINT_UPDATES)
KINDS: tuple[JobKind, ...] = (*(noun.kind for noun in _NOUNS), JUDGE)
"""Every kind of job that a worker can run."""
