"""What a user of modalbase imports: readers and writers of measurement files, and the client of the service.

No database and no server is needed for it. `modalbase.read_uff(path)` yields what is in a Universal File Format file;
`modalbase.formats` has all the formats, and `modalbase.client` the connection to a service.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from modalbase.formats.errors import FormatError
    from modalbase.formats.machine_csv import read_machine_csv
    from modalbase.formats.uff import UffError
    from modalbase.formats.uff import read_file as read_uff
    from modalbase.formats.uff.write import write_file as write_uff

    __version__: str

__all__ = ["FormatError", "UffError", "__version__", "read_machine_csv", "read_uff", "write_uff"]

_HOMES = {
    "FormatError": ("modalbase.formats.errors", "FormatError"),
    "UffError": ("modalbase.formats.uff", "UffError"),
    "read_machine_csv": ("modalbase.formats.machine_csv", "read_machine_csv"),
    "read_uff": ("modalbase.formats.uff", "read_file"),
    "write_uff": ("modalbase.formats.uff.write", "write_file"),
}

if not TYPE_CHECKING:  # a checker is to know the names above, and no others

    def __getattr__(name: str) -> Any:
        """A member when it is first asked for, so that the command's start does not wait for numpy."""
        if name == "__version__":
            return import_module("importlib.metadata").version("modalbase")
        if name in _HOMES:
            module, member = _HOMES[name]
            return getattr(import_module(module), member)
        raise AttributeError(f"module 'modalbase' has no attribute {name!r}")
