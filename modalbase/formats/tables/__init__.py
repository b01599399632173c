"""Tables of text, whatever program wrote them: hits, recordings, FRFs, points, dofs and coupons are
read by it.

numbers   one cell: a number, a time of day, a date, nothing, or words
layout    what the lines of a table are: its encoding, separator, decimal sign, headings, units, and where data begin
preamble  what lines above the data state: units, factors, a sampling rate
sizes     sizes of a specimen among it
reader    the rows of a table, line by line, and its columns as arrays

Nothing here imports numpy: the command reads points by it.
"""

from modalbase.formats.tables.layout import Layout, Stated, layout_of
from modalbase.formats.tables.numbers import is_number, number_reader, real, whole
from modalbase.formats.tables.reader import (
    WORKBOOK,
    TextTable,
    open_table,
    read_rows,
    whole_rows,
)

__all__ = [
    "WORKBOOK",
    "Layout",
    "Stated",
    "TextTable",
    "is_number",
    "layout_of",
    "number_reader",
    "open_table",
    "read_rows",
    "real",
    "whole",
    "whole_rows",
]
