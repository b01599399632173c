"""Time blocks of hammer tests."""

from __future__ import annotations

from io import BytesIO
from typing import Any

from modalbase.objects.thing import Thing


class Record(Thing):
    """One time block: the force or a response of one hit."""

    word, path = "record", "records/{}"

    def samples(self) -> tuple[Any, Any]:
        """(T,) times in s and (T,) samples in SI, as numpy arrays."""
        import numpy as np

        content = self.lab.rest.get_record_data(self.fields["id"], format="npz")
        with np.load(BytesIO(content)) as arrays:
            return arrays["time_s"], arrays["samples"]

    def sep005(self) -> dict[str, Any]:
        """The block as a time series of SDyPy's SEP 5, with its place and hit in fields of their own."""
        from modalbase.formats.records.blocks import TimeBlock
        from modalbase.formats.records.sep005 import records_to_sep005

        known = {name: self.fields[name] for name in TimeBlock.__dataclass_fields__ if name != "samples"}
        return records_to_sep005([TimeBlock(**known, samples=self.samples()[1])])[0]

    def delete(self) -> None:
        """Delete it for good."""
        self.lab.rest.delete_record(self.fields["id"])
