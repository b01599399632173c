"""Transmissibilities of a recording of responses alone, as clients get them: JSON, arrays, columns,
UFF.
"""

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from fecore.errors import InputError
from fecore.findings import texts
from fecore.frf import Dof
from fecore.signal import HalfSpectra, Transmissibilities, transmissibilities
from modalbase.formats import uff
from service.nouns.recordings.functions import function_of
from service.nouns.recordings.schemas import SensorOut, TransmissibilityOut

TYPE = 5
"""Of a transmissibility in set 58."""


def made_of(spectra: HalfSpectra, named: Sequence[str]) -> Transmissibilities:
    """Transmissibilities of a recording with the references that a request names, `point:direction`.

    Raises:
        InputError: the spectra have no such reference, or references are alike; names them.
    """
    dofs = [Dof(*map(int, each.split(":"))) for each in named]
    if strange := [
        each for each, dof in zip(named, dofs, strict=True) if dof not in spectra.references
    ]:
        own = ", ".join(f"{dof.point}:{dof.direction}" for dof in spectra.references)
        why = f"is no reference of the spectra, which have {own}; state it as a reference of a processing"
        raise InputError("references", f"{strange[0]} {why}")
    return transmissibilities(spectra, dofs or None)


def as_json(made: Transmissibilities) -> TransmissibilityOut:
    """As JSON."""
    return TransmissibilityOut(
        frequency_hz=made.frequency_hz.tolist(),
        responses=[_sensor(dof) for dof in made.responses],
        references=[_sensor(dof) for dof in made.references],
        real=made.values.real.tolist(),
        imag=made.values.imag.tolist(),
        variance=made.variance.tolist(),
        coherence=made.coherence.tolist(),
        averages=made.averages,
        warnings=list(texts(made.notes)),
    )


def arrays_of(made: Transmissibilities) -> dict[str, Any]:
    """As arrays: `values` and `variance` (N, R, L), `coherence` (N, L)."""
    return {
        "frequency_hz": made.frequency_hz,
        "values": made.values,
        "variance": made.variance,
        "coherence": made.coherence,
        "averages": made.averages,
        "responses": np.array([(dof.point, dof.direction) for dof in made.responses]),
        "references": np.array([(dof.point, dof.direction) for dof in made.references]),
        "warnings": np.array(list(texts(made.notes)), dtype=np.str_),
    }


def columns_of(made: Transmissibilities) -> dict[str, Any]:
    """As columns, a row for each line of each pair."""
    n, r, lines = made.values.shape
    pairs = list(itertools.product(made.responses, made.references))
    places = {
        f"{side}_{what}": np.repeat([getattr(pair[k], what) for pair in pairs], lines)
        for k, side in enumerate(("response", "reference"))
        for what in ("point", "direction")
    }
    return {
        **places,
        "frequency_hz": np.tile(made.frequency_hz, n * r),
        "real": made.values.real.ravel(),
        "imag": made.values.imag.ravel(),
        "variance": made.variance.ravel(),
        "coherence": np.repeat(made.coherence, r, axis=0).ravel(),
    }


def functions_of(made: Transmissibilities, label: str) -> Iterator[uff.Function]:
    """Each with its multiple coherence; those of a reference with itself are left out."""
    for row, response in enumerate(made.responses):
        for column, reference in enumerate(made.references):
            if response in made.references:
                continue
            for kind, values in (
                (TYPE, made.values[row, column]),
                (uff.COHERENCE, made.coherence[row]),
            ):
                yield function_of(
                    label, (response, reference), made.frequency_hz, values, function_type=kind
                )


def _sensor(dof: Dof) -> SensorOut:
    return SensorOut(point=dof.point, direction=dof.direction)
