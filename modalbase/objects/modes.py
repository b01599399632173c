"""Mode sets: natural frequencies, damping ratios, shapes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from modalbase.client.mode_tables import beside_lines, mode_set_cells
from modalbase.objects.table import Table
from modalbase.objects.thing import Thing

COLUMNS = ("number", "frequency_hz", "damping_ratio", "frequency_sd_hz", "damping_sd", "probability")


class ModeSet(Thing):
    """Modes of a campaign that were typed in, read from a file, or identified; printing it shows all that is known of them."""

    word, path = "mode set", "mode-sets/{}"

    def __str__(self) -> str:
        return "\n".join([str(self.modes), *beside_lines(self.fields["details"])])

    @property
    def modes(self) -> Table:
        """Frequencies in Hz, damping ratios, their standard deviations, and the probability that each is a mode."""
        rows = [{name: mode.get(name) for name in COLUMNS} for mode in self.fields["modes"]]
        return Table(rows, key="number", shown=mode_set_cells(rows))

    @property
    def doubtful(self) -> Table:
        """Uncertain poles of an identification, each with its `probability` and `reason`; none of a set from elsewhere."""
        return Table(self.fields["details"].get("doubtful", []), key="frequency_hz")

    @property
    def warnings(self) -> list[str]:
        """What to know of an identification before one uses it; none of a set from elsewhere."""
        return list(self.fields["details"].get("warnings", ()))

    def edit(
        self, *, keep: Mapping[float, str] | None = None, drop: Mapping[float, str] | None = None, name: str
    ) -> ModeSet:
        """A new mode set with poles kept and dropped by hand; it records who decided what and why.

        Args:
            keep: frequency in Hz of uncertain or refused poles to keep, each with the reason.
            drop: frequency in Hz of modes to drop, each with the reason.
            name: of the new set.

        Raises:
            ClientError: a frequency names no pole of the set, or no mode is left.
        """
        both = ((True, keep or {}), (False, drop or {}))
        decisions = [
            {"frequency_hz": hz, "keep": which, "reason": why} for which, poles in both for hz, why in poles.items()
        ]
        return ModeSet(
            self.lab, self.lab.connection.post(f"{self.address}/edits", {"name": name, "decisions": decisions})
        )

    @property
    def frequency_hz(self) -> Any:
        """(M,) numpy array."""
        import numpy as np

        return np.array([mode["frequency_hz"] for mode in self.fields["modes"]])

    @property
    def damping_ratio(self) -> Any:
        """(M,) numpy array, NaN where a mode has none."""
        import numpy as np

        return np.array([mode["damping_ratio"] for mode in self.fields["modes"]], dtype=float)

    def shapes(self) -> tuple[list[tuple[int, int]], Any]:
        """N degrees of freedom as (point, direction), and the shapes, complex (M, N), NaN where a value is not known."""
        import numpy as np

        dofs = sorted({(v["point"], v["direction"]) for mode in self.fields["modes"] for v in mode["shape"] or ()})
        place = {dof: i for i, dof in enumerate(dofs)}
        values = np.full((len(self.fields["modes"]), len(dofs)), np.nan, dtype=complex)
        for row, mode in zip(values, self.fields["modes"], strict=True):
            for value in mode["shape"] or ():
                row[place[value["point"], value["direction"]]] = complex(value["real"], value["imag"])
        return dofs, values
