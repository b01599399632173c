"""Where the features come together: their routers for the API and their kinds of job for the worker.

Importing this module imports every table, which is what the comparison of models and migrations needs.
A new feature adds its router and its kinds here and nowhere else.
"""

from __future__ import annotations

from fastapi import APIRouter

from service.access.routes import router as access
from service.jobs import JobKind

ROUTERS: tuple[APIRouter, ...] = (access,)
"""Everything under `/api/v1`, in the order of the documentation page."""

KINDS: tuple[JobKind, ...] = ()
"""Every kind of job that a worker can run."""
