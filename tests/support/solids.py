"""A plate with a rib of 20-node bricks, as a user of CalculiX has it: its matrices part by part,
and FRFs of its modes.
"""

import io
import subprocess
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from modalbase.formats.uff import Frf, GridPoint
from modalbase.formats.uff.content import Axis
from modalbase.formats.uff.write import encode
from tests.support.beams import add_noise
from tests.support.calculix import Solid, solid
from tests.support.calculix import modes as modes_of

MODULI = {"plate": 25e3, "rib": 20e3}
"""N/mm², nominal; lengths are mm, masses t."""

_GRID = np.linspace(0, 300, 11), (-30.0, -4.0, 4.0, 30.0), (-30.0, -15.0, 0.0, 8.0)


def _part(_x: float, y: float, z: float) -> str | None:
    return "plate" if z > 0 else "rib" if abs(y) < 4 else None


def _solid(moduli: dict[str, float]) -> Solid:
    return solid(
        _GRID,
        _part,
        {
            name: [
                *(f"*MATERIAL, NAME={name}", "*ELASTIC", f"{E:g},0.3", "*DENSITY", "1.85E-9"),
                f"*SOLID SECTION, ELSET={name}, MATERIAL={name}",
            ]
            for name, E in moduli.items()
        },
    )


def _places() -> dict[int, tuple[float, float, float]]:
    """Of nodes by number, mm."""
    return {
        n: (float(x), float(y), float(z))
        for n, (x, y, z) in enumerate(_solid(MODULI).places, start=1)
    }


def stored_matrices() -> bytes:
    """What CalculiX stores, in a zip: K of each part, where the other's modulus is a millionth, M,
    dofs and nodes.
    """
    files: dict[str, bytes] = {}
    for part in MODULI:
        step = ["*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "*END STEP", ""]
        alone = {name: E * (1 if name == part else 1e-6) for name, E in MODULI.items()}
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "t.inp").write_text("\n".join([*_solid(alone).deck, *step]))
            subprocess.run(["ccx", "-i", "t"], cwd=folder, check=True, capture_output=True)
            files |= {f"K_{part}.sti": Path(folder, "t.sti").read_bytes()}
            files |= {f"t.{end}": Path(folder, f"t.{end}").read_bytes() for end in ("mas", "dof")}
    rows = [",".join(map(str, (n, *xyz))) for n, xyz in _places().items()]
    files["nodes.csv"] = "\n".join(["node,x,y,z", *rows, ""]).encode()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def solved(
    factors: dict[str, float], nodes: list[int], modes: int = 20
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies in Hz and (n, p, 3) mass-normalised shapes, SI, of the free body with these
    factors of its moduli.
    """
    moduli = {name: E * factors[name] for name, E in MODULI.items()}
    hz, shapes = modes_of(_solid(moduli), modes, nodes)
    return hz, shapes / np.sqrt(1e3)  # a mode of 1 t mm² is of 1000 kg


def measured(factors: dict[str, float]) -> bytes:
    """A UFF file of the body: hits down on the plate and across the rib, two sensors, 1 % noise, 1
    % damping.
    """
    places = _places()
    seen = {
        n: 3 if xyz[2] > 0 else 2
        for n, xyz in places.items()
        if xyz[0] % 60 == 30 and xyz[1:] in _WHERE
    }
    hz, shapes = solved(factors, list(seen))
    hz[:6] = 0.0
    along = np.array([shapes[:, row, axis - 1] for row, axis in enumerate(seen.values())])
    lines, contents = np.arange(50.0, 4000.0, 2.0), []
    omega, natural = 2 * np.pi * lines, 2 * np.pi * hz[:, None]
    points = [
        GridPoint(n, (x / 1e3, y / 1e3, z / 1e3)) for n, (x, y, z) in places.items() if n in seen
    ]
    dofs = list(seen.items())
    for sensor in (0, next(k for k, (_, axis) in enumerate(dofs) if axis == 2)):
        gains = along[:, :, None] * along[sensor][None, :, None]
        frfs = np.sum(
            gains * -(omega**2) / (natural**2 - omega**2 + 2j * 0.01 * natural * omega), axis=1
        )
        for dof, values in zip(
            dofs, add_noise(frfs, 0.01, 1.0, np.random.default_rng(sensor)), strict=True
        ):
            ids = ("", "", "", "", "")
            axis = Axis(50.0, 2.0, len(lines))
            contents.append(Frf(0, "", ids, *dofs[sensor], *dof, "accelerance", axis, values))
    return b"".join(encode([*points, *contents]))


_WHERE = ((-30.0, 8.0), (30.0, 8.0), (-4.0, -30.0), (-4.0, -15.0))
"""y and z of the points."""
