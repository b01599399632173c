"""The service's nouns as Python objects, for scripts and notebooks: `modalbase.connect()` gives the
first one.

They know the service by HTTP alone. A class is loaded when it is first asked for, httpx by the first
connection, numpy by what has arrays; xarray and pandas where they are installed and asked for by
name. Each module imports those below it in this list alone:

laboratory    the way in, and what one may see
people        users and API keys
projects      projects and structures
archives      what an archive has, read into a project
archive_file  an archive on this machine's disk, checked
campaigns     campaigns and their records
structures    coupon tests, models, forecasts, monitors and alarms of a structure
jobs          what a worker does, and what it finds: mode sets and results
frfs          FRFs as numpy arrays
search        what a search finds, and trends
thing         what all of them are made of: access to a service, fields, tables, figures
files         to the service and from it; the formats that their names say
finding       ids by name
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from modalbase.objects.campaigns import Campaign
    from modalbase.objects.jobs import Import, ModeSet, Result, UpdateJob
    from modalbase.objects.laboratory import Laboratory, connect
    from modalbase.objects.projects import Project, Structure
    from modalbase.objects.structures import Alarm, CouponBatch, Model, Monitor
    from modalbase.objects.thing import Thing

__all__ = [
    "Alarm",
    "Campaign",
    "CouponBatch",
    "Import",
    "Laboratory",
    "ModeSet",
    "Model",
    "Monitor",
    "Project",
    "Result",
    "Structure",
    "Thing",
    "UpdateJob",
    "connect",
]

_HOMES = {
    "campaigns": ("Campaign",),
    "jobs": ("Import", "ModeSet", "Result", "UpdateJob"),
    "laboratory": ("Laboratory", "connect"),
    "projects": ("Project", "Structure"),
    "structures": ("Alarm", "CouponBatch", "Model", "Monitor"),
    "thing": ("Thing",),
}

if not TYPE_CHECKING:  # a checker is to know the names above, and no others

    def __getattr__(name: str) -> Any:
        """A member when it is first asked for, so that a command starts fast."""
        for module, names in _HOMES.items():
            if name in names:
                return getattr(import_module(f"{__name__}.{module}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
