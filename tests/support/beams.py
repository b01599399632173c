"""Synthetic FRFs of the paper's cantilever without a finite element model, and readers of the
shared data.
"""

from pathlib import Path

import numpy as np

from fecore.correlation import mac
from fecore.frf import Dof, FrfSet
from fecore.modal import Identification

PAPER_HZ = np.array([25.61, 160.85, 399.28, 442.65, 867.96])
PAPER_ZETA = np.array([0.1556, 0.0284, 0.0243, 0.0147, 0.0126])
#: Torsion and bending above a 1000 Hz band, as the finite element model has them.
ABOVE_HZ = np.array([1204.5, 1416.5])
ABOVE_ZETA = np.array([0.0126, 0.0126])
DRIVING_POINT = 33


def cantilever_shapes(points: np.ndarray) -> np.ndarray:
    """(7, p) shapes at (x/L, y/b): bending 1, 2, torsion 1, bending 3, 4, torsion 2, bending 5."""
    x, y = points.T
    beta = np.array([1.87510407, 4.69409113, 7.85475744, 10.99554073, 14.13716839])
    sigma = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))
    bend = [
        np.cosh(b * x) - np.cos(b * x) - s * (np.sinh(b * x) - np.sin(b * x))
        for b, s in zip(beta, sigma, strict=True)
    ]
    twist = [2 * np.sqrt(6) * y * np.sin((2 * k - 1) * np.pi * x / 2) for k in (1, 2)]
    return np.array([bend[0], bend[1], twist[0], bend[2], bend[3], twist[1], bend[4]])


def grid() -> np.ndarray:
    """(33, 2) the blind-open grid: 11 stations by 3 rows, numbered along x within a station."""
    return np.array([(i / 11, j / 2) for i in range(1, 12) for j in (-1, 0, 1)])


def receptance(
    omega: np.ndarray, hz: np.ndarray, zeta: np.ndarray, left: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """(p, L) Σ φ_i φ_j / (ω_k² - ω² + 2iζ_kω_kω)."""
    w = 2 * np.pi * hz[:, None]
    return (left * right[:, None]).T @ (1 / (w**2 - omega**2 + 2j * zeta[:, None] * w * omega))


def paper_frfs(
    noise: float, seed: int = 0, lines: int = 1000, mass: float = 0.407, multiplicative: float = 0.5
) -> FrfSet:
    """33 accelerances of the paper's cantilever (roving hammer, driving point 33), noise as
    `add_noise`.
    """
    frequency = np.linspace(1000 / lines, 1000, lines)
    shapes = cantilever_shapes(grid()) / np.sqrt(mass)
    omega = 2 * np.pi * frequency
    hz, zeta = np.append(PAPER_HZ, ABOVE_HZ), np.append(PAPER_ZETA, ABOVE_ZETA)
    values = -(omega**2) * receptance(omega, hz, zeta, shapes, shapes[:, DRIVING_POINT - 1])
    values = add_noise(values, noise, multiplicative, np.random.default_rng(seed))
    points = range(1, 34)
    return FrfSet(frequency, values, (Dof(33, 3),) * 33, tuple(Dof(p, 3) for p in points))


def add_noise(
    values: np.ndarray, noise: float, multiplicative: float, rng: np.random.Generator
) -> np.ndarray:
    """H (1 + mult g1) + add rms(H) g2, g complex Gaussian of unit variance, rms over each
    record.
    """
    g = (rng.standard_normal((2, 2, *values.shape)) * np.sqrt(0.5)).view()
    one, two = g[0, 0] + 1j * g[0, 1], g[1, 0] + 1j * g[1, 1]
    rms = np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True))
    return values * (1 + noise * multiplicative * one) + noise * rms * two


def read_uff(path: Path) -> FrfSet:
    """The FRFs of a UFF file, by pyuff."""
    import pyuff

    file = pyuff.UFF(str(path))
    sets = [file.read_sets(int(i)) for i in np.flatnonzero(np.asarray(file.get_set_types()) == 58)]
    return FrfSet(
        np.asarray(sets[0]["x"], dtype=float),
        np.array([s["data"] for s in sets], dtype=complex),
        tuple(Dof(int(s["rsp_node"]), int(s["rsp_dir"])) for s in sets),
        tuple(Dof(int(s["ref_node"]), int(s["ref_dir"])) for s in sets),
    )


PAPER_SHAPES = cantilever_shapes(grid())[:5]
LINES = 500  # 2 Hz apart, a fourth of the narrowest mode's half-power bandwidth


def assert_papers_modes(found: Identification, f: float, zeta: float, shape: float = 0.999) -> None:
    """The five modes of the paper, within relative tolerances on f and ζ and a least MAC of the
    real shapes.
    """
    assert len(found.modes) == 5, found.modes.frequency_hz
    assert np.allclose(found.modes.frequency_hz, PAPER_HZ, rtol=f)
    assert np.allclose(found.modes.damping_ratio, PAPER_ZETA, rtol=zeta)
    assert np.all(np.diag(mac(found.shapes.real, PAPER_SHAPES)) >= shape)
