"""Time blocks of hammer tests: arrays of npz, .mat, CSV and wav files, a mapping that says what
they are, blocks in SI.

variables, text     arrays of a file by name: npz, .mat, CSV, wav; tables of text
arrays              such arrays with their sampling rate, and time blocks
npz, hdf5           channels that are arrays of a file, or columns of them, part by part
clocks              channels with a rate and a start each
tdms, mdf, wav, uff, sep005
mapping, proposal   which variable is what, stated or proposed
recording           one long record of many hits
scale               sensitivities and units to SI
"""

from modalbase.formats.records.arrays import TimeBlock, Variables, described
from modalbase.formats.records.mapping import (
    ChannelMapping,
    Mapping,
    blocks_of,
    read_mapping,
)
from modalbase.formats.records.proposal import propose, propose_recording
from modalbase.formats.records.sep005 import Place, records_from_sep005, records_to_sep005
from modalbase.formats.records.variables import read_variables

__all__ = [
    "ChannelMapping",
    "Mapping",
    "Place",
    "TimeBlock",
    "Variables",
    "blocks_of",
    "described",
    "propose",
    "propose_recording",
    "read_mapping",
    "read_variables",
    "records_from_sep005",
    "records_to_sep005",
]
