"""From a described structure to the core's specimen: one homogenised layer, or its plies as they are laid up."""

from __future__ import annotations

from dataclasses import replace

from fecore.body.laminate import OrthotropicMaterial, homogenise, section
from fecore.body.layered import PLY_CONSTANTS, LayeredSpecimen
from fecore.body.model import PointMass
from fecore.body.specimen import Specimen, kind_of
from fecore.errors import InputError
from service.store.structures.schemas import Geometry, Laminate, StructureIn
from service.store.updating.schemas import RecipeIn


def body_of(
    structure: StructureIn, boundary: str, recipe: RecipeIn, masses: tuple[PointMass, ...] = ()
) -> Specimen | LayeredSpecimen:
    """What a recipe updates: with its springs, and with plies where it names constants of plies (E1, angle_2).

    A recipe that names no parameters updates one homogenised layer where the laminate has one, else the plies.

    Raises:
        InputError: the structure lacks what a model needs, or its laminate has no equivalent single layer and the recipe
            names constants of one.
    """
    springs = tuple(spring.to_core() for spring in recipe.springs)
    return replace(_named(structure, boundary, recipe, masses), springs=springs, zones=tuple(recipe.zones_m))


def _named(
    structure: StructureIn, boundary: str, recipe: RecipeIn, masses: tuple[PointMass, ...]
) -> Specimen | LayeredSpecimen:
    """The body whose constants a recipe names."""
    if structure.laminate is None:
        return nominal_specimen(structure, boundary, masses)
    names = [parameter.name for parameter in recipe.parameters or ()]
    if any(kind_of(name) in (*PLY_CONSTANTS, "angle") for name in names):
        return _layered(structure, structure.laminate, boundary, masses)
    try:
        return nominal_specimen(structure, boundary, masses)
    except InputError as error:
        if error.field != "laminate":
            raise
        if recipe.parameters is not None:
            hint = "name constants of its plies as parameters: " + ", ".join(PLY_CONSTANTS)
            raise InputError("laminate", f"{error.message}; {hint}") from None
        return _layered(structure, structure.laminate, boundary, masses)


def nominal_specimen(structure: StructureIn, boundary: str, masses: tuple[PointMass, ...] = ()) -> Specimen:
    """A structure as the core's specimen, with nominal constants.

    Raises:
        InputError: the structure lacks what a model needs, or is a laminate without an equivalent single layer.
    """
    g, density = _known(structure)
    pieces = tuple(piece.to_core() for piece in structure.pieces or ())
    if structure.laminate is not None:
        # Shear stresses that balance bending ply by ply: for plies alike that is κ = 5/6, in a sandwich the core gives way.
        plies = [ply.to_core(density) for ply in structure.laminate.plies]
        material = homogenise(section(plies, shear="equilibrium"))
        # The structure's own thickness and density were measured on the whole; the plies' are nominal.
        material = replace(material, density=density)
        return Specimen(g.length_m, g.width_m, g.thickness_m, material, boundary, masses, pieces=pieces)  # type: ignore[arg-type]
    m = structure.material
    assert m is not None, "a structure has a laminate or a material"
    material = OrthotropicMaterial(
        Ex=m.Ex_Pa, Ey=m.Ey_Pa, Gxy=m.Gxy_Pa, Gxz=m.Gxz_Pa, Gyz=m.Gyz_Pa, nu_xy=m.nu_xy, density=density
    )
    return Specimen(g.length_m, g.width_m, g.thickness_m, material, boundary, masses, pieces=pieces)  # type: ignore[arg-type]


def _layered(
    structure: StructureIn, laminate: Laminate, boundary: str, masses: tuple[PointMass, ...]
) -> LayeredSpecimen:
    """A structure's laminate as the core's specimen of plies, with nominal constants."""
    g, density = _known(structure)
    plies = tuple(ply.to_core(density) for ply in laminate.plies)
    pieces = tuple(piece.to_core() for piece in structure.pieces or ())
    size = g.length_m, g.width_m, g.thickness_m
    return LayeredSpecimen(*size, plies, density, boundary, masses, pieces=pieces)  # type: ignore[arg-type]


def _known(structure: StructureIn) -> tuple[Geometry, float]:
    """Geometry and density of a structure that states all that a model needs."""
    g, density = structure.geometry, structure.density_kg_m3
    lacking = [name for name, value in (("geometry", g), ("density_kg_m3", density)) if value is None]
    lacking += ["laminate or material"] if structure.laminate is None and structure.material is None else []
    if g is None or density is None or lacking:
        raise InputError(
            "structure",
            f"states no {', no '.join(lacking)}: an update needs them for its model; an identification does not",
        )
    return g, density
