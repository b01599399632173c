"""Measurement files: bytes to frozen dataclasses and back. Pure: no database, no web, no finite
element core.

uff           Universal File Format, in and out
frfs          FRFs as npz and CSV, in and out, and as Arrow, out
machine_csv   text files of testing machines, in
"""

from modalbase.formats import frfs, machine_csv, uff
from modalbase.formats.errors import FormatError

__all__ = ["FormatError", "frfs", "machine_csv", "uff"]
