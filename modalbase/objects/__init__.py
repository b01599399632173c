"""The service's nouns as Python objects, for scripts and notebooks: `modalbase.connect()` gives the
first one.

They know the service by HTTP alone. numpy is imported by what has arrays, when it is asked for;
xarray and pandas where they are installed and asked for by name. Each module imports those below it
in this list alone:

laboratory    the way in, and what one may see
projects      projects and structures
archives      what an archive has, read into a project
campaigns     campaigns and their records
structures    coupon tests, models, forecasts, monitors and alarms of a structure
jobs          what a worker does, and what it finds: mode sets and results
frfs          FRFs as numpy arrays
thing         what all of them are made of: access to a service, fields, tables, figures
"""

from modalbase.objects.laboratory import Laboratory, connect

__all__ = ["Laboratory", "connect"]
