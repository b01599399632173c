"""Text files of testing machines: the columns that are wanted, in SI, with a report on how they were read."""

from modalbase.formats.machine_csv.read import Column, MachineFile, Run, read_machine_csv

__all__ = ["Column", "MachineFile", "Run", "read_machine_csv"]
