"""From a described structure to the core's body: a strip of one homogenised layer or of its plies,
or a body in space.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.body.constants import Body, Parameter
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.matrices import MatrixBody
from fecore.body.sections import PLY_CONSTANTS, ShellSection, homogenise, section
from fecore.body.specimen import LayeredSpecimen, OrientedSpecimen, Specimen
from fecore.body.structure import Structure
from fecore.body.supports import PointMass, of_boundary
from fecore.errors import InputError
from fecore.quantities import kind_of
from fecore.updating.inputs import tolerance_of
from modalbase.formats.models.matrices import MatrixModel
from modalbase.formats.models.model import FiniteElementModel
from service.compute.models.bodies import body_of_model
from service.compute.models.matrices import body_of_matrices
from service.nouns.coupons.operations import batch_for, summarise
from service.nouns.structures.models import load_model
from service.nouns.structures.schemas import Geometry, Laminate, Material, StructureIn
from service.nouns.updates.schemas import OF_CONSTANTS, InputsIn, RecipeIn
from service.platform.access import User
from service.platform.errors import Invalid


def body_of(
    structure: StructureIn,
    boundary: str,
    recipe: RecipeIn,
    masses: tuple[PointMass, ...] = (),
    model: FiniteElementModel | MatrixModel | None = None,
) -> Specimen | LayeredSpecimen | Structure | MatrixBody:
    """What a recipe updates: with its springs, and with plies where it names constants of plies
    (E1, angle_2).

    A recipe that names no parameters updates one homogenised layer where the laminate has one, else
    the plies; of a body in space the constants of each set.

    Args:
        structure: as it is described.
        boundary: of the campaign.
        recipe: what is updated.
        masses: what the body carried.
        model: in SI, of a structure that is one.

    Raises:
        InputError: the structure lacks what a model needs, or its laminate has no equivalent single
            layer and the recipe names constants of one.
    """
    springs = tuple(spring.to_core() for spring in recipe.springs)
    if is_in_space(structure):
        if recipe.zones_m:
            raise InputError("zones_m", "are of strips and plates; a body in space has sets")
        if isinstance(model, MatrixModel):
            if recipe.junctions == "off" or any(
                spring.edge is not None for spring in recipe.springs
            ):
                raise InputError("recipe", "names junctions or an edge, and matrices have neither")
            return replace(body_of_matrices(model, boundary), springs=springs).carrying(masses)
        body = (
            nominal_body(structure, boundary) if model is None else body_of_model(model, boundary)
        )
        _require_edges(recipe, body)
        joined = recipe.junctions == "on"
        held = (*body.springs, *springs)
        return replace(body, springs=held, with_joints=joined).carrying(masses)
    require_no_choice_of_joints(recipe)
    return replace(
        _named(structure, boundary, recipe, masses), springs=springs, zones=tuple(recipe.zones_m)
    )


def body_for(
    session: Session,
    structure: StructureIn,
    boundary: str,
    recipe: RecipeIn,
    masses: tuple[PointMass, ...] = (),
) -> Body:
    """What a recipe updates of a structure, whether it is described or a model that was sent.

    Raises:
        InputError: as of `body_of`.
    """
    model = None if structure.model is None else load_model(session, structure.model)
    return body_of(structure, boundary, recipe, masses, model)


def joint_body(
    session: Session,
    structure: StructureIn,
    boundary: str,
    recipe: RecipeIn,
    *,
    masses: tuple[PointMass, ...] = (),
    first: StructureIn | None = None,
    angle_deg: float | None = None,
) -> Body:
    """What a joint update, or a plan for one, makes of a structure.

    Args:
        session: for a model that was sent.
        structure: as it is described.
        boundary: of the campaign.
        recipe: of all campaigns.
        masses: what the body carried.
        first: the structure whose material all share; default: this one.
        angle_deg: of the material's x axis from the specimen's; default: as the structure's plies
            lie.

    Raises:
        InputError: the structure lacks what a model needs.
    """
    if is_in_space(structure):
        model = None if structure.model is None else load_model(session, structure.model)
        return body_of(structure, boundary, recipe, masses, model)
    require_no_choice_of_joints(recipe)
    plain = replace(
        nominal_specimen(of_its_material(structure), boundary, masses), layers=layers_of(structure)
    )
    own = material_of(structure)[1] if angle_deg is None else angle_deg
    return oriented(plain, material_of(first or structure)[0], own)


def _require_edges(recipe: RecipeIn, body: Structure) -> None:
    """Refuse a spring along an edge that a body in space has not; its stiffness is per metre of the
    walls' edges there.
    """
    for number, spring in enumerate(recipe.springs):
        if spring.edge is not None and spring.edge not in body.mesh.node_sets:
            edges = (
                ", ".join(name for name in ("start", "end") if name in body.mesh.node_sets)
                or "none"
            )
            raise InputError(
                f"springs.{number}.edge", f"is {spring.edge}; this body in space has {edges}"
            )


def require_inputs(inputs: InputsIn, body: Body) -> None:
    """Refuse a stated standard deviation of what a body has not.

    Raises:
        InputError: the first such one.
    """
    used = {tolerance_of(name) for name in body.nominal}
    if body.turned(0.0) is not None:
        used.add("fibre_angle")
    for member, tolerance in OF_CONSTANTS.items():
        if getattr(inputs, member) is not None and tolerance not in used:
            has = ", ".join(name for name, of in OF_CONSTANTS.items() if of in used)
            raise InputError(
                f"inputs.{member}",
                f"is of what the body that is updated has not; it has {has or 'none'}",
            )


def coupon_constants(body: Body, sets: Sequence[str]) -> dict[str, list[str]]:
    """Which constants of a body each constant of a coupon batch is: of a body in space those of its
    sets.

    Args:
        body: that is updated.
        sets: of the batch's material; none: all that are of one material.

    Raises:
        InputError: the body lacks one of the sets.
    """
    if not body.has_elements:
        raise InputError("coupons", "give constants of materials, and matrices have factors alone")
    held = body.in_space
    if held is None:
        return {name: [name] for name in _OF_SHELL}
    names: dict[str, list[str]] = {}
    for name in sets or held.mesh.sets:
        section = held.sections.get(name)
        if section is None:
            raise InputError(
                "coupons",
                f"are of the set {name}, which this body has not; it has"
                f" {', '.join(held.mesh.sets)}",
            )
        if isinstance(section, ShellSection) and len(section.materials) > 1 and not sets:
            continue
        for constant, own in (_OF_SHELL if isinstance(section, ShellSection) else _OF_BEAM).items():
            names.setdefault(constant, []).append(f"{name}.{own}")
    return names


def recipe_parameters(
    session: Session, recipe: RecipeIn, body: Body
) -> tuple[tuple[Parameter, ...], list[str]]:
    """The recipe's parameters, with a coupon batch's mean and scatter where the recipe states none,
    and warnings.
    """
    parameters: Sequence[Parameter] = recipe.parameters_of(body)
    if recipe.prior_from_coupon_batch is None:
        return tuple(parameters), []
    batch = batch_for.row(session, recipe.prior_from_coupon_batch)
    summary = summarise(session, batch)
    measured = {
        own: name for name, names in coupon_constants(body, batch.sets).items() for own in names
    }
    warnings = [f"coupons: {warning}" for warning in summary.warnings]
    filled, without_scatter = [], []
    for parameter in parameters:
        constant: Any = measured.get(parameter.name)
        known = summary.priors.get(constant)
        if known is None:
            filled.append(parameter)
            continue
        mean = known.mean if parameter.prior_mean is None else parameter.prior_mean
        free = not parameter.fixed and parameter.tied_to is None
        scattered = summary.constants[constant].standard_deviation is not None
        prior_sd = (
            known.standard_deviation
            if parameter.prior_sd is None and free and scattered
            else parameter.prior_sd
        )
        if free and prior_sd is None:
            without_scatter.append(parameter.name)
        filled.append(replace(parameter, prior_mean=mean, prior_sd=prior_sd))
    if without_scatter:
        names = ", ".join(without_scatter)
        warnings.append(
            f"{names}: the coupon batch states no scatter, so the prior is its mean ± 30 %"
        )
    return tuple(filled), warnings


_OF_SHELL = {"Ex": "E1", "Ey": "E2", "Gxy": "G12", "nu_xy": "nu12"}
_OF_BEAM = {"Ex": "E", "Gxy": "G"}
"""What constants of coupons are called in a set."""


def is_in_space(structure: StructureIn) -> bool:
    """Whether a structure has sets with constants of their own: by its shape, or as a model that
    was sent.
    """
    return structure.shape is not None or structure.model is not None


def require_no_choice_of_joints(recipe: RecipeIn) -> None:
    """Refuse a recipe for a strip or plate that leaves joints out.

    Raises:
        InputError: it does.
    """
    if recipe.junctions == "off":
        raise InputError("junctions", "are of bodies in space; a strip or plate has none")


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


def usual_boundary(structure: StructureIn) -> str:
    """The boundary of a structure where none is stated."""
    return "cantilever" if structure.model is None else "free"


def nominal_body(structure: StructureIn, boundary: str) -> Structure:
    """A structure with a shape as the core's body in space, with nominal constants.

    Raises:
        InputError: a density is stated nowhere, or the boundary is of models.
    """
    shape = structure.shape
    assert shape is not None, "a body in space has a shape"
    return Structure(
        shape.mesh(),
        shape.sections(structure.density_kg_m3),
        of_boundary(boundary),  # type: ignore[arg-type]
        size=shape.size,
    )


def nominal_specimen(
    structure: StructureIn, boundary: str, masses: tuple[PointMass, ...] = ()
) -> Specimen:
    """A structure as the core's specimen, with nominal constants.

    Raises:
        InputError: the structure lacks what a model needs, or is a laminate without an equivalent
            single layer.
    """
    g, density = _known(structure)
    pieces = tuple(piece.to_core() for piece in structure.pieces or ())
    if structure.laminate is not None:
        # Shear stresses that balance bending ply by ply: for plies alike that is κ = 5/6, in a
        # sandwich the core gives way.
        plies = [ply.to_core(density) for ply in structure.laminate.plies]
        # The structure's own thickness and density were measured on the whole; the plies' are
        # nominal.
        material = replace(homogenise(section(plies)), density=density)
    else:
        assert structure.material is not None, "a structure has a laminate or a material"
        material = structure.material.to_core(density)
    size, layers = (g.length_m, g.width_m, g.thickness_m), layers_of(structure)
    return Specimen(*size, material, boundary, masses, pieces=pieces, layers=layers)  # type: ignore[arg-type]


def layers_of(structure: StructureIn) -> tuple[tuple[float, float], ...]:
    """(thickness, density) of the plies of a structure's laminate where these differ in density;
    none where they do not.
    """
    if structure.laminate is None:
        return ()
    plies = [ply.to_core(structure.density_kg_m3 or 0.0) for ply in structure.laminate.plies]
    layers = tuple((ply.thickness, ply.material.density) for ply in plies)
    return layers if len({density for _, density in layers}) > 1 else ()


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
    if is_in_space(structure):
        raise InputError("structure", "is a body in space, which a strip or plate is expected for")
    g, density = structure.geometry, structure.density_kg_m3
    lacking = [
        name for name, value in (("geometry", g), ("density_kg_m3", density)) if value is None
    ]
    lacking += (
        ["laminate or material"]
        if structure.laminate is None and structure.material is None
        else []
    )
    if g is None or density is None or lacking:
        raise InputError(
            "structure",
            f"states no {', no '.join(lacking)}: an update needs them for its model; an"
            " identification does not",
        )
    return g, density


def material_of(structure: StructureIn) -> tuple[OrthotropicMaterial, float]:
    """A structure's material in its own axes, and the angle in degrees at which the specimen was
    cut.

    A laminate whose plies are alike in all but thickness is one material at the plies' angle. Any
    other section is homogenised in the specimen's axes.

    Raises:
        InputError: the structure lacks what a model needs.
    """
    laminate = structure.laminate
    if laminate is not None and _is_one_material(laminate):
        ply = laminate.plies[0]
        return ply.material(structure.density_kg_m3 or ply.density_kg_m3 or 0.0), ply.angle_deg
    if laminate is not None and any(ply.angle_deg % 90 for ply in laminate.plies):
        raise InputError(
            "laminate",
            "has plies at several angles; a joint update takes one material: plies that lie alike",
        )
    return nominal_specimen(structure, "free").material, 0.0


def of_its_material(structure: StructureIn) -> StructureIn:
    """The structure with its material in the material's own axes in place of its laminate.

    Raises:
        InputError: as of `material_of`.
    """
    m, _ = material_of(structure)
    own = Material(Ex_Pa=m.Ex, Ey_Pa=m.Ey, Gxy_Pa=m.Gxy, Gxz_Pa=m.Gxz, Gyz_Pa=m.Gyz, nu_xy=m.nu_xy)
    return structure.model_copy(update={"laminate": None, "material": own})


def _is_one_material(laminate: Laminate) -> bool:
    first = laminate.plies[0]
    alike = {"thickness_m": first.thickness_m}
    return all(ply.model_copy(update=alike) == first for ply in laminate.plies)


def oriented(plain: Specimen, material: OrthotropicMaterial, angle_deg: float) -> OrientedSpecimen:
    """The specimen with the material of several, in the material's own axes; its density is its
    own.
    """
    return OrientedSpecimen(
        plain.length,
        plain.width,
        plain.thickness,
        replace(material, density=plain.material.density),
        plain.boundary,
        masses=plain.masses,
        pieces=plain.pieces,
        layers=plain.layers,
        fibre_angle=math.radians(angle_deg),
    )


def check_prior_batch(
    session: Session, user: User, recipe: RecipeIn, structure_id: UUID, pointer: str
) -> None:
    """The coupon batch that a recipe takes its priors from must be the user's and of the
    structure's material.

    Raises:
        Invalid: it is not; the pointer says where the batch is named.
    """
    if recipe.prior_from_coupon_batch is not None:
        batch = batch_for.named(session, user, recipe.prior_from_coupon_batch, pointer)
        if batch.structure_id != structure_id:
            raise Invalid(pointer, f"{batch.id} belongs to another structure")
