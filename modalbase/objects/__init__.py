"""The service's nouns as Python objects, for scripts and notebooks: `modalbase.connect()` gives the first one.

They know the service by HTTP alone. numpy is imported by what has arrays, when it is asked for; xarray and pandas where they
are installed and asked for by name.
"""

from modalbase.objects.laboratory import Laboratory, connect

__all__ = ["Laboratory", "connect"]
