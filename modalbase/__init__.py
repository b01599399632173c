"""What a user of modalbase imports: a laboratory's service as objects, and readers and writers of
measurement files.

No database and no server is needed for it. `modalbase.connect()` gives the service's projects,
structures, campaigns and jobs; `modalbase.read_uff(path)` yields what is in a Universal File Format
file. `modalbase.formats` has all the formats, `modalbase.objects` the nouns of a service,
`modalbase.watch` sends files that appear in folders, `modalbase.commands` has the commands that are
written on these, `modalbase.client` HTTP beneath,
`modalbase.archive` the name of an archive's form.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from modalbase.client.errors import ClientError, JobFailed
    from modalbase.formats.errors import FormatError
    from modalbase.formats.machine_csv import read_machine_csv
    from modalbase.formats.uff import UffError
    from modalbase.formats.uff import read_file as read_uff
    from modalbase.formats.uff.write import write_file as write_uff
    from modalbase.objects.frfs import Frfs
    from modalbase.objects.laboratory import Laboratory, connect

    __version__: str

__all__ = [
    "ClientError",
    "FormatError",
    "Frfs",
    "JobFailed",
    "Laboratory",
    "UffError",
    "__version__",
    "connect",
    "read_machine_csv",
    "read_uff",
    "write_uff",
]

_HOMES = {
    "ClientError": ("modalbase.client.errors", "ClientError"),
    "Frfs": ("modalbase.objects.frfs", "Frfs"),
    "JobFailed": ("modalbase.client.errors", "JobFailed"),
    "Laboratory": ("modalbase.objects.laboratory", "Laboratory"),
    "connect": ("modalbase.objects.laboratory", "connect"),
    "FormatError": ("modalbase.formats.errors", "FormatError"),
    "UffError": ("modalbase.formats.uff", "UffError"),
    "read_machine_csv": ("modalbase.formats.machine_csv", "read_machine_csv"),
    "read_uff": ("modalbase.formats.uff", "read_file"),
    "write_uff": ("modalbase.formats.uff.write", "write_file"),
}

if not TYPE_CHECKING:  # a checker is to know the names above, and no others

    def __getattr__(name: str) -> Any:
        """A member when it is first asked for, so that neither the command nor a script waits for
        what it does not use.
        """
        if name == "__version__":
            return import_module("importlib.metadata").version("modalbase")
        if name in _HOMES:
            module, member = _HOMES[name]
            return getattr(import_module(module), member)
        raise AttributeError(f"module 'modalbase' has no attribute {name!r}")
