"""FRFs of one quantity on one frequency axis: the files that the service takes and gives, for scripts
that make or use them without it. `modalbase.formats.registry` has the table of formats.

parts     real columns: real and imaginary parts, or magnitude and phase
kinds     what FRFs are by the words of a file
proposal  a mapping for arrays that do not say what they are
npz, hdf5, csv, json, arrow, parquet, mat, uff
"""

from modalbase.formats.frfs.csv import read_csv, write_csv
from modalbase.formats.frfs.files import read_frfs, write_frfs
from modalbase.formats.frfs.mat import read_mat
from modalbase.formats.frfs.npz import read_npz, write_npz
from modalbase.formats.frfs.table import FrfRow, Frfs, FrfTable

__all__ = [
    "FrfRow",
    "FrfTable",
    "Frfs",
    "read_csv",
    "read_frfs",
    "read_mat",
    "read_npz",
    "write_csv",
    "write_frfs",
    "write_npz",
]
