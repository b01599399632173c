"""A small angle profile of pultruded glass, measured: FRFs across both walls of a body that is not
as it was stated.
"""

from functools import cache
from itertools import count
from typing import Any

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.body.constants import Parameter
from fecore.body.structure import Structure
from fecore.frf import Dof
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import parametrise
from modalbase.formats.uff import Frf, GridPoint
from modalbase.formats.uff.content import Axis
from modalbase.formats.uff.write import encode
from modalbase.objects.frfs import Frfs
from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.bodies import nominal_body
from tests.support.beams import add_noise

ANGLE: dict[str, Any] = {
    "name": "angle",
    "density_kg_m3": 1850,
    "shape": {
        "kind": "angle",
        "length_m": 0.4,
        "width_m": 0.06,
        "height_m": 0.08,
        "material": {
            "E1_Pa": 23e9,
            "E2_Pa": 8.5e9,
            "G12_Pa": 3e9,
            "G13_Pa": 3e9,
            "G23_Pa": 2.4e9,
            "nu_12": 0.27,
        },
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


@cache
def measured(seed: int = 0, boundary: str = "free") -> bytes:
    """A UFF file: 14 hits along z and −y, two accelerometers, 1 % noise, to 500 Hz."""
    body = nominal_body(StructureIn.model_validate(ANGLE), boundary)
    return uff(body, TRUTH, points(), seed, 500.0)


I_PROFILE: dict[str, Any] = {
    **ANGLE,
    "name": "I-beam",
    "shape": {
        **ANGLE["shape"],
        "kind": "i",
        "length_m": 0.9,
        "height_m": 0.12,
        "walls": {"flange": {"thickness_m": 0.006}, "web": {"thickness_m": 0.006}},
    },
}
"""The profile of the tutorial."""


@cache
def i_profile() -> bytes:
    """FRFs of it, hung freely: its upper flange hit from above, its web from the side."""
    places = {}
    for k, x in enumerate(np.linspace(0.03, 0.87, 9)):
        places[2 * k + 1] = (float(x), 0.026 - 0.026 * (k % 3), 0.06)
        places[2 * k + 2] = (float(x), -0.003, 0.03 - 0.03 * (k % 3))
    return uff(nominal_body(StructureIn.model_validate(I_PROFILE), "free"), TRUTH, places, 0)


@cache
def deck(length: float = 1.0) -> bytes:
    """The angle as an engineer's deck for CalculiX: S8R on middle surfaces, both walls of one
    material, one end clamped.

    Args:
        length: unit of length in m; stresses are in N by its square, densities so that equations
            agree.
    """
    mesh = nominal_body(StructureIn.model_validate(ANGLE), "free").mesh
    stress, density = 1 / length**2, 1 / length**4
    lines = ["*HEADING", "angle of two walls", "*NODE, NSET=ALL"]
    lines += [
        f"{n}, {', '.join(f'{x / length:.12g}' for x in xyz)}"
        for n, xyz in enumerate(mesh.nodes, start=1)
    ]
    numbers = count(1)
    for block in mesh.blocks:
        lines.append(f"*ELEMENT, TYPE=S8R, ELSET={block.set.upper()}")
        lines += [f"{next(numbers)}, {', '.join(map(str, nodes))}" for nodes in block.nodes + 1]
    moduli = [f"{value / stress:.9g}" for value in (23e9, 8.5e9, 8.5e9, 3e9, 3e9, 2.4e9)]
    lines += [
        "*ORIENTATION, NAME=O",
        "1, 0, 0, 0, 1, 0",
        "*MATERIAL, NAME=GFRP",
        "*ELASTIC, TYPE=ENGINEERING CONSTANTS",
    ]
    lines += [
        f"{', '.join(moduli[:3])}, 0.27, 0.3, 0.35, {', '.join(moduli[3:5])},",
        f"{moduli[5]}, 293",
    ]
    lines += ["*DENSITY", f"{1850 / density:.9g}"]
    for name in mesh.sets:
        lines += [
            f"*SHELL SECTION, ELSET={name.upper()}, MATERIAL=GFRP, ORIENTATION=O",
            f"{0.004 / length:g}",
        ]
    root = (mesh.node_sets["start"] + 1).tolist()
    lines += [
        "*NSET, NSET=ROOT",
        *(", ".join(map(str, root[k : k + 8])) for k in range(0, len(root), 8)),
    ]
    lines += ["*BOUNDARY", "ROOT, 1, 6", "*STEP", "*FREQUENCY", "12", "*END STEP", ""]
    return "\n".join(lines).encode()


def askew(turn: FloatArray) -> Frfs:
    """FRFs of the free angle along axes that lie askew: rows of `turn` are these in the structure's
    frame.

    Each point is hit and felt along the axis that is nearest to its wall's normal.
    """
    body = nominal_body(StructureIn.model_validate(ANGLE), "free")
    normal = {n: 3 if n % 2 else 2 for n in points()}
    along = {n: int(np.argmax(np.abs(turn[:, axis - 1]))) + 1 for n, axis in normal.items()}
    dofs = [Dof(n, axis) for n, axis in along.items()]
    hz, pairs, values = _frfs(
        body, TRUTH, points(), dofs, [dofs[0], dofs[1]], dict.fromkeys(points(), turn)
    )
    return Frfs.from_arrays(
        hz, add_noise(values, 0.005, 1.0, np.random.default_rng(0)),
        response=[(r.point, r.direction) for r, _ in pairs], reference=[(f.point, f.direction) for _, f in pairs],
    )  # fmt: skip


def _frfs(
    body: Structure,
    truth: dict[str, float],
    places: dict[int, tuple[float, float, float]],
    hits: list[Dof],
    sensors: list[Dof],
    axes: dict[int, FloatArray],
) -> tuple[FloatArray, list[tuple[Dof, Dof]], ComplexArray]:
    """Lines, response and reference of each, and accelerances of a body with other constants."""
    prior = parametrise(body, [Parameter(name, prior_mean=value) for name, value in truth.items()])
    dofs = [Dof(dof.point, dof.axis) for dof in hits]
    forward = ForwardModel.of_dofs(prior, dofs, places, 900.0, 20, axes=axes)
    pairs = [(sensor, hit) for sensor in sensors for hit in hits]
    model = forward.solve(prior.prior_mean).frf_model(*zip(*pairs, strict=True), with_strain=False)
    hz = np.arange(5.0, 900.0, 0.5)
    return hz, pairs, model.synthesise(hz, A0 + A1 * model.eigenvalue, "accelerance")


def uff(
    body: Structure,
    truth: dict[str, float],
    places: dict[int, tuple[float, float, float]],
    seed: int,
    highest_hz: float = 900.0,
) -> bytes:
    """FRFs of a body with other constants as a UFF file."""
    hits = [Dof(n, 3 if n % 2 else -2) for n in places]
    hz, pairs, values = _frfs(body, truth, places, hits, list(_SENSORS), {})
    hz = hz[hz < highest_hz]
    values = add_noise(values[:, : hz.size], 0.005, 1.0, np.random.default_rng(seed))
    frfs = [
        Frf(0, f"{r.point} {f.point}", ("",) * 5, r.point, r.direction, f.point, f.direction, "accelerance",
            Axis(5.0, 0.5, hz.size), row)
        for (r, f), row in zip(pairs, values, strict=True)
    ]  # fmt: skip
    return b"".join(encode([*(GridPoint(n, xyz) for n, xyz in places.items()), *frfs]))
