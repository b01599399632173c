"""Tables of FRFs as Parquet: the columns of the CSV."""

from typing import IO

from modalbase.formats.arrays_out import as_parquet
from modalbase.formats.frfs.arrow import write_arrow
from modalbase.formats.frfs.table import FrfTable


def write_parquet(table: FrfTable, file: IO[bytes]) -> None:
    """Write FRFs as Parquet, a line for each frequency line of each FRF, in the columns of the CSV.

    `coherence` is null where an FRF has none. Read it with `pandas.read_parquet` or
    `polars.read_parquet`.

    Args:
        table: the FRFs; their values are taken one FRF at a time.
        file: open for writing bytes.
    """
    as_parquet(lambda stream: write_arrow(table, stream), file)
