"""Make the files of the tutorial: what an analyser, a hammer and a testing machine would have
written of one beam.

    python examples/make_tutorial.py [FOLDER]

A cantilever of 500 × 40 × 10 mm with known constants and Rayleigh damping is simulated with this
project's own model: FRFs with noise as a UFF file, time blocks of hits, one of them double, as npz,
and tensile curves as CSV. Nothing is measured.
"""

import json
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

TRUTH = OrthotropicMaterial(
    Ex=30.4e9, Ey=30e9, Gxy=5.9e9, Gxz=4.8e9, Gyz=4.8e9, nu_xy=0.15, density=2012.0
)
A0, A1 = 12.0, 6e-6
BEAM = Specimen(length=0.5, width=0.04, thickness=0.010, material=TRUTH)
ROWS, MODES, SENSOR, SEED = 8, 14, 15, 20261122
LINES_HZ = np.arange(2.0, 1001.0, 1.0)
RATE_HZ, SAMPLES = 4096, 4096
COUPON_MM = (25.0, 2.0)
RECIPE = {"band_hz": [10, 1000], "seed": 1}
MAPPING = {
    "sample_rate_hz": {"variable": "fs"},
    "hit": {"variable": "hit"},
    "channels": [
        {"variable": "force", "quantity": "force", "point": {"variable": "point"}},
        {"variable": "acceleration", "quantity": "acceleration", "point": SENSOR},
    ],
}
COUPONS = {
    "standard": "D3039",
    "dimensions": {"unit": "mm", "width": [COUPON_MM[0]], "thickness": [COUPON_MM[1]]},
    "columns": {"force": "Load", "strain": "Strain"},
}


def grid_points() -> dict[int, tuple[float, float, float]]:
    """Two rows of eight points along the edges."""
    places = [
        (BEAM.length * row / ROWS, BEAM.width * (side - 0.5), 0.0)
        for row in range(1, ROWS + 1)
        for side in range(2)
    ]
    return dict(enumerate(places, start=1))


def accelerances(lines_hz: np.ndarray) -> np.ndarray:
    """(16, lines) accelerance at the sensor for a hammer at each point, m/s² per N."""
    points = grid_points()
    places = np.array(list(points.values()))[:, :2]
    parametrisation = parametrise(BEAM)
    state = ForwardModel(
        BEAM, parametrisation, along_z(points), places, MODES, reduced=False
    ).solve(parametrisation.prior_mean)
    model = state.frf_model([Dof(SENSOR, 3)] * len(points), [Dof(point, 3) for point in points])
    values: np.ndarray = model.synthesise(lines_hz, A0 + A1 * model.omega**2)
    return values


def write_frfs(file: Path, rng: np.random.Generator) -> None:
    """Header, grid points and 16 FRFs with 1 % of noise, single precision, binary."""
    values = accelerances(LINES_HZ)
    noise = rng.standard_normal((2, *values.shape)) * 0.01 / np.sqrt(2)
    rms = np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True))
    spectra = (values + (noise[0] + 1j * noise[1]) * rms).astype(np.complex64)
    header = FileHeader(
        dataset=1,
        model_name="beam of the tutorial",
        description="simulated; not measured",
        program="modalbase examples/make_tutorial.py",
        written=datetime(2026, 3, 2).strftime("%d-%b-%y %H:%M:%S"),
    )
    frfs = [
        Frf(
            dataset=0,
            label=f"FRF {SENSOR}Z/{point}Z",
            id_lines=("", f"hammer at {point}, accelerometer at {SENSOR}", "", "", ""),
            response_point=SENSOR,
            response_direction=3,
            reference_point=point,
            reference_direction=3,
            quantity="accelerance",
            frequency=Axis(float(LINES_HZ[0]), 1.0, LINES_HZ.size),
            values=row,
        )
        for point, row in zip(grid_points(), spectra, strict=True)
    ]
    write_file(
        file,
        [header, *(GridPoint(number, place) for number, place in grid_points().items()), *frfs],
    )


def write_hits(file: Path, rng: np.random.Generator) -> None:
    """Three hits at each of two points, SI; the second hit at the second point is double."""
    lines = np.arange(SAMPLES // 2 + 1) * RATE_HZ / SAMPLES
    used = np.clip(lines, 1.0, None)
    transfer = accelerances(used) * (lines > 0)
    force, response, points, numbers = [], [], [], []
    for point in (3, 9):
        for number in (1, 2, 3):
            pulse = _pulse(200, 100 * rng.uniform(0.8, 1.2))
            if (point, number) == (9, 2):
                pulse += _pulse(320, 35.0)
            blocks = np.fft.irfft(np.fft.rfft(pulse) * transfer[point - 1], SAMPLES)
            force.append(pulse + 0.02 * rng.standard_normal(SAMPLES))
            response.append(blocks + 0.02 * rng.standard_normal(SAMPLES))
            points.append(point)
            numbers.append(number)
    arrays = {"force": np.float32(force), "acceleration": np.float32(response)}
    np.savez_compressed(
        file, **arrays, fs=np.array(float(RATE_HZ)), point=np.array(points), hit=np.array(numbers)
    )


def write_points(file: Path) -> None:
    """The grid points in mm, which a UFF file holds and hits do not."""
    rows = [f"{number},{1e3 * x:g},{1e3 * y:g}" for number, (x, y, _) in grid_points().items()]
    file.write_text("\n".join(["label,x_mm,y_mm", *rows, ""]))


def _pulse(start: int, newton: float) -> np.ndarray:
    """(SAMPLES,) half a sine of 4 samples."""
    block = np.zeros(SAMPLES)
    block[start : start + 5] = newton * np.sin(np.pi * np.arange(5) / 4)
    return block


def write_coupons(folder: Path, rng: np.random.Generator) -> None:
    """Five tensile tests with a scatter of 1.5 % in the modulus."""
    area = COUPON_MM[0] * COUPON_MM[1] * 1e-6
    strain = np.linspace(0, 0.008, 81)
    for number in range(1, 6):
        load = TRUTH.Ex * (1 + 0.015 * rng.standard_normal()) * strain * area / 1e3
        load += 0.002 * rng.standard_normal(load.size) * (strain > 0)
        rows = [f"{force:.4f},{100 * e:.5f}" for force, e in zip(load, strain, strict=True)]
        (folder / f"C{number}.csv").write_text("\n".join(["Load (kN),Strain (%)", *rows, ""]))


def make(folder: Path) -> None:
    """Write all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(SEED)
    write_frfs(folder / "beam.uff", rng)
    write_hits(folder / "hits.npz", rng)
    write_coupons(folder, rng)
    write_points(folder / "points.csv")
    for name, value in (("recipe", RECIPE), ("hits-mapping", MAPPING), ("coupons", COUPONS)):
        (folder / f"{name}.json").write_text(json.dumps(value, indent=2) + "\n")


if __name__ == "__main__":
    make(Path(sys.argv[1] if len(sys.argv) > 1 else "tutorial"))
