"""FRFs as JSON, as they are written for scripts."""

import json
from typing import IO

from modalbase.formats.frfs.table import DOFS, UNITS, FrfTable


def write_json(table: FrfTable, file: IO[bytes]) -> None:
    """`{quantity, unit, frequency_hz, frfs: [{id, response_point, …, real, imag, coherence}]}`."""
    head = {
        "quantity": table.quantity,
        "unit": UNITS[table.quantity],
        "frequency_hz": table.frequency_hz.tolist(),
    }
    file.write(json.dumps(head, ensure_ascii=False)[:-1].encode() + b', "frfs": [')
    for i, (frf, values, coherence) in enumerate(table.both()):
        item = {
            "id": str(frf.id),
            "label": frf.label,
            **{key: getattr(frf, key) for key in DOFS},
            "averages": frf.averages,
            "real": values.real.tolist(),
            "imag": values.imag.tolist(),
            "coherence": None if coherence is None else coherence.tolist(),
        }
        file.write(
            (b", " if i else b"") + json.dumps(item, ensure_ascii=False, allow_nan=False).encode()
        )
    file.write(b"]}")
