"""FRFs as numpy arrays, and as pyuff, sdypy and xarray have them."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from modalbase.formats import frfs as files
from modalbase.formats.frfs import FrfRow
from modalbase.formats.frfs.table import UNITS
from modalbase.formats.uff.frf import RESPONSE_TYPES
from modalbase.objects.thing import library

ORDINATES = {quantity: code for code, quantity in RESPONSE_TYPES.items()}
"""Codes of the ordinate's numerator in UFF 58: displacement, velocity, acceleration."""

FORCE = 13
"""Code of the ordinate's denominator in UFF 58."""

MOST_NAMED = 10
"""FRFs of a plot that its legend names."""


@dataclass(frozen=True, eq=False)
class Frfs(files.Frfs):
    """FRFs of one quantity on one frequency axis.

    Attributes:
        frequency_hz: (L,) frequency lines, Hz.
        values: (N, L) complex; m/s², m/s or m per N.
        frfs: N rows that say what they are: points, signed directions, label, averages.
        quantity: accelerance, mobility or receptance.
        coherence: (N, L) ordinary coherence γ², NaN where one FRF has none; None where none has.
    """

    def __repr__(self) -> str:
        band = f"{self.frequency_hz[0]:g} … {self.frequency_hz[-1]:g} Hz"
        return (
            f"<{len(self)} FRFs ({self.quantity}, {UNITS[self.quantity]}), {self.frequency_hz.size}"
            f" lines, {band}>"
        )

    def __len__(self) -> int:
        return len(self.frfs)

    @property
    def response_points(self) -> NDArray[np.int64]:
        """(N,) grid points of the responses."""
        return np.array([row.response_point for row in self.frfs])

    @property
    def reference_points(self) -> NDArray[np.int64]:
        """(N,) grid points of the references."""
        return np.array([row.reference_point for row in self.frfs])

    @classmethod
    def from_arrays(
        cls,
        frequency_hz: Any,
        values: Any,
        *,
        response: Sequence[tuple[int, int]],
        reference: Sequence[tuple[int, int]],
        quantity: str = "accelerance",
    ) -> Self:
        """FRFs of arrays that a script has.

        Args:
            frequency_hz: (L,) frequency lines, Hz.
            values: (N, L) complex.
            response: N responses as (point, signed direction): ±1 … ±3 along x, y, z.
            reference: N references alike.
            quantity: accelerance, mobility or receptance.

        Raises:
            ValueError: the numbers of rows differ.
        """
        pairs = zip(response, reference, strict=True)
        rows = tuple(FrfRow.between((*one, *other)) for one, other in pairs)
        spectra = np.atleast_2d(np.asarray(values, dtype=np.complex128))
        frequency = np.asarray(frequency_hz, dtype=np.float64)
        if spectra.shape != (len(rows), frequency.size):
            raise ValueError(
                f"values have shape {spectra.shape}, expected {(len(rows), frequency.size)}"
            )
        return cls(frequency, spectra, rows, quantity)  # type: ignore[arg-type]  # the service judges the quantity

    @classmethod
    def from_npz(cls, content: bytes) -> Self:
        """FRFs of an npz file's bytes, as the service and `to_npz` write them.

        Raises:
            FormatError: the bytes are not such a file.
        """
        with tempfile.NamedTemporaryFile(suffix=".npz") as file:
            file.write(content)
            file.flush()
            table = files.read_npz(Path(file.name))
        return cls(table.frequency_hz, table.values, table.frfs, table.quantity, table.coherence)

    def to_npz(self) -> bytes:
        """The bytes of an npz file."""
        stream = BytesIO()
        files.write_npz(self, stream)
        return stream.getvalue()

    @classmethod
    def from_pyuff(cls, datasets: Sequence[Mapping[str, Any]]) -> Self:
        """FRFs of datasets 58 as pyuff reads them: `pyuff.UFF(file).read_sets()`. Other types are
        passed over.

        Raises:
            ValueError: there is no FRF among them, or they have several axes or quantities.
        """
        frfs = [one for one in datasets if one.get("type") == 58 and one.get("func_type") == 4]
        if not frfs:
            raise ValueError("no dataset 58 is an FRF (function type 4)")
        quantities = {
            RESPONSE_TYPES.get(int(one.get("ordinate_spec_data_type", 12))) for one in frfs
        }
        axis = np.asarray(frfs[0]["x"], dtype=np.float64)
        if len(quantities) > 1 or any(not np.array_equal(axis, one["x"]) for one in frfs):
            raise ValueError(
                "the FRFs have several frequency axes or quantities; take those of one"
            )
        rows = tuple(
            FrfRow.between(
                (
                    int(one["rsp_node"]),
                    int(one["rsp_dir"]),
                    int(one["ref_node"]),
                    int(one["ref_dir"]),
                ),
                str(one.get("id1", "")).strip(),
            )
            for one in frfs
        )
        values = np.array([one["data"] for one in frfs], dtype=np.complex128)
        return cls(axis, values, rows, quantities.pop() or "accelerance")

    def to_pyuff(self) -> list[dict[str, Any]]:
        """Datasets 58 as pyuff writes them: `pyuff.UFF(file).write_sets(frfs.to_pyuff())`."""
        step = float(np.diff(self.frequency_hz).mean()) if self.frequency_hz.size > 1 else 0.0
        even = bool(np.allclose(np.diff(self.frequency_hz), step))
        return [
            {
                "type": 58, "binary": 0, "id1": row.label or "NONE", "id2": "NONE", "id3": "NONE", "id4": "NONE",
                "id5": "NONE", "func_type": 4, "ver_num": 0, "load_case_id": 0,
                "rsp_ent_name": "NONE", "rsp_node": row.response_point, "rsp_dir": row.response_direction,
                "ref_ent_name": "NONE", "ref_node": row.reference_point, "ref_dir": row.reference_direction,
                "ord_data_type": 6, "num_pts": self.frequency_hz.size, "abscissa_spacing": int(even),
                "abscissa_min": float(self.frequency_hz[0]), "abscissa_inc": step, "z_axis_value": 0.0,
                "abscissa_spec_data_type": 18, "abscissa_axis_lab": "frequency", "abscissa_axis_units_lab": "Hz",
                "abscissa_force_unit_exp": 0, "abscissa_len_unit_exp": 0, "abscissa_temp_unit_exp": 0,
                "ordinate_spec_data_type": ORDINATES[self.quantity], "ordinate_axis_lab": self.quantity,
                "ordinate_axis_units_lab": UNITS[self.quantity].split("/N")[0],
                "orddenom_spec_data_type": FORCE, "orddenom_axis_lab": "force", "orddenom_axis_units_lab": "N",
                "x": self.frequency_hz, "data": values,
            }
            for row, values in self.spectra()
        ]  # fmt: skip

    def to_sdypy(self) -> dict[str, Any]:
        """What `Model` of sdypy-EMA 0.31 takes: `EMA.Model(**frfs.to_sdypy())`; (N, L) values, (L,)
        Hz.
        """
        return {"frf": self.values, "freq": self.frequency_hz, "frf_form": self.quantity}

    @classmethod
    def from_sdypy(
        cls,
        model: Any,
        *,
        response: Sequence[tuple[int, int]],
        reference: Sequence[tuple[int, int]],
    ) -> Self:
        """The FRFs of an `EMA.Model` of sdypy, in the quantity that it was given.

        Args:
            model: the model; its `frf` (N, L), `freq` (L,) in Hz and `frf_form`.
            response: N responses as (point, signed direction).
            reference: N references alike.
        """
        return cls.from_arrays(
            model.freq, model.frf, response=response, reference=reference, quantity=model.frf_form
        )

    def to_xarray(self) -> Any:
        """An `xarray.DataArray` with the dimensions `frf` and `frequency_hz`, and points and
        directions as coordinates.

        Raises:
            ClientError: xarray is not installed.
        """
        coords: dict[str, Any] = {"frequency_hz": self.frequency_hz}
        for name in files.table.DOFS:
            coords[name] = ("frf", [getattr(row, name) for row in self.frfs])
        attrs = {"units": UNITS[self.quantity]}
        return library("xarray").DataArray(
            self.values, coords, ("frf", "frequency_hz"), name=self.quantity, attrs=attrs
        )

    def plot(self) -> Any:
        """Magnitude and phase over frequency as a `matplotlib.figure.Figure`, which a notebook
        shows; `savefig` writes it.

        Raises:
            ClientError: matplotlib is not installed.
        """
        pyplot = library("matplotlib.pyplot")
        figure, (magnitude, phase) = pyplot.subplots(2, sharex=True, layout="constrained")
        pyplot.close(figure)  # else a notebook would show it twice
        for row, values in self.spectra():
            name = (
                f"{row.response_point}:{row.response_direction:+d} /"
                f" {row.reference_point}:{row.reference_direction:+d}"
            )
            magnitude.semilogy(self.frequency_hz, np.abs(values), label=name)
            phase.plot(self.frequency_hz, np.angle(values, deg=True))
        magnitude.set_ylabel(f"|{self.quantity}| [{UNITS[self.quantity]}]")
        phase.set(xlabel="frequency [Hz]", ylabel="phase [°]")
        if len(self) <= MOST_NAMED:
            magnitude.legend()
        return figure
