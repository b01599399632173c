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

    def delete(self) -> None:
        """Delete it for good."""
        self.lab.rest.delete_record(self.fields["id"])
