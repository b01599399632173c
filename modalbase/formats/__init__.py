"""Measurement files: bytes to frozen dataclasses and back. Pure: no database, no web, no finite
element core.

registry      the table of formats of measured data
uff           Universal File Format, in and out
frfs          FRFs as npz and CSV, in and out, and as Arrow, out
machine_csv   text files of testing machines, in
"""
