"""What the paper says of its cantilever: Mondal and Chakraborty (2015), Tables 3 and 4, with the
errata of `docs/errata.md`.
"""

from importlib.resources import files
from typing import Any

MODES = (
    {"frequency_hz": 25.61, "damping_ratio": 0.1556},
    {"frequency_hz": 160.85, "damping_ratio": 0.0284},
    {"frequency_hz": 399.28, "damping_ratio": 0.0243},
    {"frequency_hz": 442.65, "damping_ratio": 0.0147},
    {"frequency_hz": 867.96, "damping_ratio": 0.0126},
)
"""Table 3, measured."""

COUPONS_PA = {"Ex": 33.05e9, "Ey": 31.80e9, "Gxy": 5.73e9}
"""Table 4, from coupons by ASTM D3039: means alone are printed."""

UPDATED = {
    "Ex": 31.66e9,
    "Ey": 31.80e9,
    "Gxy": 6.30e9,
    "Gxz": 5.37e9,
    "Gyz": 5.37e9,
    "a0": 42.25,
    "a1": 1.10e-5,
}
"""Table 4 and section 4, updated by the authors."""

STRUCTURE: dict[str, Any] = {
    "name": "pultruded FRP beam",
    "geometry": {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.010},
    "density_kg_m3": 2012.0,
    "material": {
        "Ex_Pa": 33.05e9,
        "Ey_Pa": 31.80e9,
        "Gxy_Pa": 5.73e9,
        "Gxz_Pa": 4.5e9,
        "Gyz_Pa": 4.5e9,
        "nu_xy": 0.15,
    },
}
"""Nominal values: coupons where there are any, a handbook's for the transverse shear moduli. t: see
the errata.
"""

CAMPAIGN: dict[str, Any] = {
    "name": "cantilever, roving hammer",
    "boundary": "cantilever",
    "instruments": {
        "hammer": {"maker": "Brüel & Kjær", "model": "8206-002"},
        "sensor": {"maker": "Brüel & Kjær", "model": "DeltaTron 4507"},
        "analyser": {"maker": "Brüel & Kjær", "program": "PULSE LabShop"},
    },
}


def uff_file() -> bytes:
    """The UFF file that `examples/make_paper_beam.py` wrote."""
    return (files("service.pages") / "static" / "paper_beam.uff").read_bytes()
