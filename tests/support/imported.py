"""Models as the service's job reads them, and their frequencies by the core."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.constants import Body
from fecore.updating.forecasts import ForecastOrder, forecast
from modalbase.formats.models.matrices import MatrixModel
from service.compute.models.bodies import body_of_model
from service.compute.models.keeping import model_of
from service.compute.models.matrices import body_of_matrices
from service.tasks.model.compute import DeckInputs, read_deck


class Imported(NamedTuple):
    """A model that was read: what the service says of it, and the core's body."""

    document: dict[str, Any]
    body: Body

    def frequencies(self, modes: int | None = None) -> FloatArray:
        """(n,) Hz of its forecast."""
        return forecast(self.body, ForecastOrder(modes=modes)).frequency_hz

    def notes(self) -> dict[str, tuple[list[int], bool]]:
        """Lines of what was not used, by card, and whether it changes modes."""
        return {one["card"]: (one["lines"], one["changes"]) for one in self.document["ignored"]}


def imported(
    name: str,
    content: bytes | str,
    units: str = "mm-N-t",
    *,
    accept: Sequence[str] = (),
    sections: Mapping[str, Any] | None = None,
    boundary: str = "as_modelled",
) -> Imported:
    """Read a file as the service's job does.

    Raises:
        Invalid: as of `read_deck`.
    """
    with TemporaryDirectory() as folder:
        path = Path(folder) / "deck"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        (output,) = read_deck(
            DeckInputs(path, name, units, tuple(accept), sections), lambda *_: None
        )
    model = model_of(output.arrays)
    if isinstance(model, MatrixModel):
        return Imported(output.document, body_of_matrices(model, boundary))
    return Imported(output.document, body_of_model(model, boundary))


def npz_of(nodes: Any, dofs: Any, stiffness: Any, mass: Any) -> dict[str, np.ndarray]:
    """Arrays of a model of matrices; nodes have numbers from 1."""
    places = np.asarray(nodes, dtype=float)
    table = np.column_stack([np.arange(1, len(places) + 1), places])
    return {
        "nodes": table,
        "dofs": np.asarray(dofs),
        "K_0": np.asarray(stiffness),
        "M_0": np.asarray(mass),
    }
