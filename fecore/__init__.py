"""Finite element model updating of fibre reinforced plastic beams: pure numpy and scipy, usable
alone in a notebook.

frf, modes           FRFs and measured modes, as all rooms hand them on
signal               hits to FRFs
modal                FRFs to modes
body, dynamics       a body to its matrices; these to modes and FRFs
correlation          the table of criteria, and pairs of modes
updating             measurement and body to parameters with their uncertainty
coupons              tensile tests to moduli
trend, temperatures  many campaigns over time; over temperature
quantities           the table of quantities
findings, errors     what a user has to know; what is refused
arrays, normal, least_squares  of numbers

What a notebook needs is exported here; it stands in the order in which data flows::

    specimen = Specimen(0.5, 0.04, 0.01, OrthotropicMaterial(...), "cantilever")
    found = identify([FrfSet(frequency_hz, values, responses, references)])       # modes with their covariance
    result = update(Measurement(frfs, points), specimen, Recipe())                # parameters with their uncertainty

All quantities are SI (m, kg, s, Pa); frequencies are in Hz only where a name says `_hz`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fecore.body.beam_specimen import BeamSpecimen
    from fecore.body.constants import Parameter
    from fecore.body.laminate import OrthotropicMaterial, Ply
    from fecore.body.sections import homogenise, section
    from fecore.body.specimen import Specimen
    from fecore.body.supports import Edge, PointMass, Spring
    from fecore.correlation import comac, csac, csf, fdac, frac, mac, sac
    from fecore.errors import (
        FecoreError,
        IdentificationError,
        InputError,
        ModelError,
        UpdatingError,
    )
    from fecore.frf import Dof, FrfSet
    from fecore.modal import Identification, Options, identify
    from fecore.modes import MeasuredModes
    from fecore.updating.forward import ForwardModel
    from fecore.updating.measurement import HoldOut, Measurement, Recipe
    from fecore.updating.pipeline import update
    from fecore.updating.result import UpdateResult

__version__ = "0.2.0"

_HOMES = {
    "body.constants": ("Parameter",),
    "body.laminate": ("OrthotropicMaterial", "Ply"),
    "body.beam_specimen": ("BeamSpecimen",),
    "body.sections": ("homogenise", "section"),
    "body.specimen": ("Specimen",),
    "body.supports": ("Edge", "PointMass", "Spring"),
    "correlation": ("comac", "csac", "csf", "fdac", "frac", "mac", "sac"),
    "errors": ("FecoreError", "IdentificationError", "InputError", "ModelError", "UpdatingError"),
    "frf": ("Dof", "FrfSet"),
    "modal": ("Identification", "Options", "identify"),
    "modes": ("MeasuredModes",),
    "updating.forward": ("ForwardModel",),
    "updating.measurement": ("HoldOut", "Measurement", "Recipe"),
    "updating.pipeline": ("update",),
    "updating.result": ("UpdateResult",),
}

__all__ = [
    "BeamSpecimen",
    "Dof",
    "Edge",
    "FecoreError",
    "ForwardModel",
    "FrfSet",
    "HoldOut",
    "Identification",
    "IdentificationError",
    "InputError",
    "MeasuredModes",
    "Measurement",
    "ModelError",
    "Options",
    "OrthotropicMaterial",
    "Parameter",
    "Ply",
    "PointMass",
    "Recipe",
    "Specimen",
    "Spring",
    "UpdateResult",
    "UpdatingError",
    "__version__",
    "comac",
    "csac",
    "csf",
    "fdac",
    "frac",
    "homogenise",
    "identify",
    "mac",
    "sac",
    "section",
    "update",
]

if not TYPE_CHECKING:  # a checker is to know the names above, and no others

    def __getattr__(name: str) -> Any:
        """A member when it is first asked for: what needs the version alone does not wait for
        scipy.
        """
        for module, names in _HOMES.items():
            if name in names:
                return getattr(import_module(f"fecore.{module}"), name)
        raise AttributeError(f"module 'fecore' has no attribute {name!r}")
