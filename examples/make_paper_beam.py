"""Make the demonstration's UFF file: FRFs of the paper's cantilever as its published measurements
describe it.

    python examples/make_paper_beam.py [FILE]

Mondal and Chakraborty (2015) print the natural frequencies and damping ratios that they measured
(Table 3) but not their FRFs. This script gives a body that has exactly those five modes: mode
shapes come from this project's own model with the paper's updated constants (Table 4, t = 10.00
mm), frequencies and damping from Table 3, higher modes from the model with the damping of mode 5.
Noise is added from a fixed seed. So the file is made, not measured.

The paper's accelerometer sat at point 23, in the middle of the width, which is a node of the
model's torsion modes; here it sits at the tip's corner, point 33.
"""

import sys
from datetime import datetime
from pathlib import Path

import numpy as np

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.frf import Dof, along_z
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import parametrise
from modalbase.formats.uff.content import Axis, FileHeader, Frf, GridPoint
from modalbase.formats.uff.write import write_file

MEASURED_HZ = np.array([25.61, 160.85, 399.28, 442.65, 867.96])
MEASURED_DAMPING = np.array([15.56, 2.84, 2.43, 1.47, 1.26]) / 100
TABLE_4 = OrthotropicMaterial(
    Ex=31.66e9, Ey=31.80e9, Gxy=6.30e9, Gxz=5.37e9, Gyz=5.37e9, nu_xy=0.15, density=2012.0
)
BEAM = Specimen(length=0.5, width=0.04, thickness=0.010, material=TABLE_4)

ROWS, COLUMNS = 11, 3
ACCELEROMETER = 33
LINES_HZ = np.arange(1.0, 1001.0)
MODES = 16
NOISE_OF_VALUE, NOISE_OF_RECORD = 0.005, 0.01
SEED = 20150409  # the day on which the paper was accepted


def grid_points() -> dict[int, tuple[float, float, float]]:
    """33 points, numbered across the width row by row from the clamped end, as the paper's Figure 5
    does.
    """
    places = [
        (BEAM.length * row / ROWS, BEAM.width * (column / (COLUMNS - 1) - 0.5), BEAM.thickness / 2)
        for row in range(1, ROWS + 1)
        for column in range(COLUMNS)
    ]
    return dict(enumerate(places, start=1))


def accelerances(points: dict[int, tuple[float, float, float]]) -> np.ndarray:
    """(33, lines) accelerance at the accelerometer for a hammer at each point, m/s² per N, without
    noise.
    """
    places = np.array(list(points.values()))[:, :2]
    parametrisation = parametrise(BEAM)
    forward = ForwardModel(BEAM, parametrisation, along_z(points), places, MODES, reduced=False)
    state = forward.solve(parametrisation.prior_mean)
    hammer = [Dof(point, 3) for point in points]
    model = state.frf_model([Dof(ACCELEROMETER, 3)] * len(hammer), hammer)
    omega = model.omega.copy()
    omega[: MEASURED_HZ.size] = 2 * np.pi * MEASURED_HZ
    ratio = np.full(omega.size, MEASURED_DAMPING[-1])
    ratio[: MEASURED_HZ.size] = MEASURED_DAMPING
    return model.with_eigenvalue(omega**2).synthesise(LINES_HZ, 2 * ratio * omega)


def with_noise(values: np.ndarray) -> np.ndarray:
    """Complex Gaussian noise: a share of each value, and a share of each record's rms."""
    random = np.random.default_rng(SEED)
    part, floor = (
        (random.standard_normal(values.shape) + 1j * random.standard_normal(values.shape))
        / np.sqrt(2)
        for _ in range(2)
    )
    rms = np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True))
    return values * (1 + NOISE_OF_VALUE * part) + NOISE_OF_RECORD * rms * floor


def make(file: Path) -> None:
    """Write the file: header, units, grid points and 33 FRFs in single precision, binary."""
    points = grid_points()
    spectra = with_noise(accelerances(points)).astype(np.complex64)
    header = FileHeader(
        dataset=1,
        model_name="FRP cantilever of Mondal and Chakraborty (2015)",
        description=(
            "synthesised from the published natural frequencies and damping ratios; not measured"
        ),
        program="modalbase examples/make_paper_beam.py",
        written=datetime(2015, 4, 9).strftime("%d-%b-%y %H:%M:%S"),
    )
    frfs = [
        Frf(
            dataset=0,
            label=f"FRF {ACCELEROMETER}Z/{point}Z",
            id_lines=("", f"hammer at {point}, accelerometer at {ACCELEROMETER}", "", "", ""),
            response_point=ACCELEROMETER,
            response_direction=3,
            reference_point=point,
            reference_direction=3,
            quantity="accelerance",
            frequency=Axis(float(LINES_HZ[0]), float(LINES_HZ[1] - LINES_HZ[0]), LINES_HZ.size),
            values=values,
        )
        for point, values in zip(points, spectra, strict=True)
    ]
    write_file(
        file, [header, *(GridPoint(number, place) for number, place in points.items()), *frfs]
    )


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "paper_beam.uff")
    make(target)
    print(f"{target}: {target.stat().st_size} bytes")
