"""A small angle profile of pultruded glass, measured: FRFs across both walls of a body that is not as it was stated."""

from __future__ import annotations

from typing import Any

import numpy as np

from fecore.body.structure import Structure
from fecore.frf import Dof
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import Parameter, parametrise
from modalbase.formats.uff import Frf, GridPoint
from modalbase.formats.uff.content import Axis
from modalbase.formats.uff.write import encode
from service.store.structures.schemas import StructureIn
from service.store.updating.bodies import nominal_body
from tests.support.beams import add_noise

ANGLE: dict[str, Any] = {
    "name": "angle",
    "density_kg_m3": 1850,
    "shape": {
        "kind": "angle",
        "length_m": 0.4,
        "width_m": 0.06,
        "height_m": 0.08,
        "material": {"E1_Pa": 23e9, "E2_Pa": 8.5e9, "G12_Pa": 3e9, "G13_Pa": 3e9, "G23_Pa": 2.4e9, "nu_12": 0.27},
        "walls": {"flange": {"thickness_m": 0.004}, "web": {"thickness_m": 0.004}},
    },
}
"""As a client describes it."""

TRUTH = {
    "flange.E1": 25e9,
    "web.E1": 21.5e9,
    "flange.E2": 8.0e9,
    "web.E2": 9.1e9,
    "flange.G12": 2.7e9,
    "web.G12": 3.2e9,
}
A0, A1 = 6.0, 6e-6
_SENSORS = Dof(1, 3), Dof(2, -2)


def points() -> dict[int, tuple[float, float, float]]:
    """Odd ones on the flange's lower face, even ones on the web's outer face."""
    found = {}
    for k, x in enumerate(np.linspace(0.02, 0.38, 7)):
        found[2 * k + 1] = (float(x), 0.025 - 0.004 * (k % 3), -0.04)
        found[2 * k + 2] = (float(x), -0.03, 0.034 - 0.02 * (k % 3))
    return found


def measured(seed: int = 0, boundary: str = "free") -> bytes:
    """A UFF file: 14 hits along z and −y, two accelerometers, 1 % noise."""
    body = nominal_body(StructureIn.model_validate(ANGLE), boundary)
    return uff(body, TRUTH, points(), seed)


def uff(body: Structure, truth: dict[str, float], places: dict[int, tuple[float, float, float]], seed: int) -> bytes:
    """FRFs of a body with other constants as a UFF file."""
    prior = parametrise(body, [Parameter(name, prior_mean=value) for name, value in truth.items()])
    hits = [Dof(n, 3 if n % 2 else -2) for n in places]
    dofs = [Dof(dof.point, dof.axis) for dof in hits]
    forward = ForwardModel.of_dofs(prior, dofs, places, 900.0, 20)
    pairs = [(sensor, hit) for sensor in _SENSORS for hit in hits]
    model = forward.solve(prior.prior_mean).frf_model(*zip(*pairs, strict=True), with_strain=False)
    hz = np.arange(5.0, 900.0, 0.5)
    values = model.synthesise(hz, A0 + A1 * model.eigenvalue, "accelerance")
    values = add_noise(values, 0.005, 1.0, np.random.default_rng(seed))
    frfs = [
        Frf(0, f"{r.point} {f.point}", ("",) * 5, r.point, r.direction, f.point, f.direction, "accelerance",
            Axis(5.0, 0.5, hz.size), row)
        for (r, f), row in zip(pairs, values, strict=True)
    ]  # fmt: skip
    return b"".join(encode([*(GridPoint(n, xyz) for n, xyz in places.items()), *frfs]))
