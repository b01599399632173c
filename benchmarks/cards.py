"""Decks of updated models against the model itself: natural frequencies by CalculiX (`ccx`, where it is installed).

Strips and plates with random constants, sizes and boundaries; the deck is written as `modalbase cards` writes it, and every
frequency of the model in the band is compared with the nearest of the deck.
"""

from __future__ import annotations

import shutil

import numpy as np

from benchmarks.forward_peers import ccx_frequencies
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.dynamics.eigen import normal_modes
from modalbase.formats.decks import Deck, write_shells, write_solids

DRAWS, SEED, MODES = 40, 7, 6
USUAL = np.array([30e9, 15e9, 5e9, 4e9, 3.5e9])


def draw(rng: np.random.Generator) -> Specimen:
    """A specimen of 0.2 to 1 m, 4 to 20 times as long as thick or more, constants within 30 % of usual ones."""
    length = rng.uniform(0.2, 1.0)
    width = length * rng.uniform(0.06, 0.5)
    thickness = min(length / rng.uniform(30, 100), width / 4)
    moduli = USUAL * rng.uniform(0.7, 1.3, 5)
    material = OrthotropicMaterial(*map(float, moduli), nu_xy=float(rng.uniform(0.1, 0.3)), density=1900.0)
    boundary = str(rng.choice(["cantilever", "free", "simply_supported"]))
    return Specimen(length, width, thickness, material, boundary, divisions=(40, 8))  # type: ignore[arg-type]


def frequencies(specimen: Specimen) -> np.ndarray:
    """(MODES,) natural frequencies of the model in Hz, rigid motions left out."""
    model = specimen.model
    K = model.stiffness.at(model.stiffness_coefficients(specimen.section))
    M = model.mass.at(model.mass_coefficients(specimen.section))
    found = normal_modes(K, M, MODES + 6, model.rigid_modes).frequency_hz
    return found[found > 1.0][:MODES]


def main(draws: int = DRAWS, seed: int = SEED) -> None:
    """Print the largest errors of each draw, and of all."""
    if shutil.which("ccx") is None:
        print("  (ccx is not installed: nothing to compare with)")
        return
    rng = np.random.default_rng(seed)
    worst: dict[str, list[float]] = {"solid": [], "shell": []}
    for _ in range(draws):
        specimen = draw(rng)
        m, ours = specimen.material, frequencies(specimen)
        moduli = (m.Ex, m.Ey, m.Gxy, m.Gxz, m.Gyz)
        size = specimen.length, specimen.width, specimen.thickness
        deck = Deck(*size, moduli, m.nu_xy, m.density, specimen.boundary, 2 * MODES + 12)
        for name, text in (("solid", write_solids(deck)), ("shell", write_shells(deck, corrected=True))):
            found = ccx_frequencies(text)
            worst[name].append(float(np.abs(found[:, None] / ours - 1).min(axis=0).max()))
        shown = ", ".join(f"{name} {100 * errors[-1]:.3f} %" for name, errors in worst.items())
        print(
            f"  {specimen.boundary:16s} {1e3 * size[0]:4.0f} x {1e3 * size[1]:3.0f} x {1e3 * size[2]:4.1f} mm  {shown}",
            flush=True,
        )
    for name, errors in worst.items():
        print(f"  {name}: median {100 * np.median(errors):.3f} %, worst {100 * max(errors):.3f} % of {draws}")
