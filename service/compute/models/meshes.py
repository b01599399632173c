"""Meshes that users send, with the sections that they state of the sets."""

from collections.abc import Callable, Mapping
from pathlib import PurePosixPath
from typing import Any

from modalbase.formats.errors import FormatError
from modalbase.formats.meshes import MeshFile
from modalbase.formats.models.meshes import (
    MeshSets,
    model_of_mesh,
    read_gmsh,
    read_uff_mesh,
    read_vtk,
    read_vtu,
)
from modalbase.formats.models.meshes.cells import plain
from modalbase.formats.models.model import FiniteElementModel, Material, Ply, ShellSection, Where
from modalbase.formats.models.units import units_of

MESHES: Mapping[str, Callable[[bytes], MeshFile]] = {
    ".msh": read_gmsh, ".vtk": read_vtk, ".vtu": read_vtu, ".uff": read_uff_mesh, ".unv": read_uff_mesh,
}  # fmt: skip
"""Readers by the end of a file's name."""

_CONSTANTS = {f"{name}_Pa": name for name in ("E", "E1", "E2", "G12", "G13", "G23")} | {
    "nu": "nu", "nu_12": "nu12", "density_kg_m3": "density",
}  # fmt: skip


def kind_of_member(member: str) -> str:
    """What a member of a section is in `accept`, as `density:plate`."""
    name = _CONSTANTS.get(member, member.rpartition("_")[0])
    return "modulus" if name[0] in "EG" else name.removesuffix("12")


def is_of_sections(name: str) -> bool:
    """Whether a name in `accept` answers what is asked of sections as they are sent."""
    return name.partition(":")[0].lower() in ("thickness", "density", "modulus", "nu", "angle")


def is_mesh(filename: str) -> bool:
    """Whether a file's name says that it is a mesh without properties."""
    return PurePosixPath(filename).suffix.lower() in MESHES


def mesh_in_si(
    content: bytes, filename: str, units: str | None, sections: Mapping[str, Mapping[str, Any]]
) -> FiniteElementModel:
    """The model of a mesh with its sections.

    Args:
        content: the file.
        filename: its end says the format.
        units: of the file; of these the length counts.
        sections: by set, as a client states them.

    Raises:
        FormatError: the file cannot be read, the length is not stated or stated twice, or the
            sections do not fit the sets.
    """
    ending = PurePosixPath(filename).suffix.lower()
    mesh = MESHES[ending](content)
    return model_of_mesh(mesh, ending[1:], _length(mesh, units), _stated(sections))


def _length(mesh: MeshFile, units: str | None) -> float:
    stated = mesh.length_m if units is None else units_of(units).length
    if stated is None:
        raise FormatError(
            "units",
            "are not stated, and the file has none: m-N-kg for coordinates in m, mm-N-t for mm",
        )
    if mesh.length_m is not None and abs(stated / mesh.length_m - 1) > 1e-6:
        raise FormatError(
            "units",
            f"have the length {stated:g} m, but set 164 of the file says {mesh.length_m:g} m",
        )
    return stated


def _stated(sections: Mapping[str, Mapping[str, Any]]) -> MeshSets:
    if len(known := {plain(name): stated for name, stated in sections.items()}) < len(sections):
        raise FormatError("sections", "name a set twice: capitals and signs of a name do not count")
    sections, materials = known, dict[str, Material]()
    shells = {}
    for name, stated in sections.items():
        if stated.get("held_dofs"):
            continue
        plies = []
        for ply in stated.get("plies") or [
            {**(stated.get("material") or stated["isotropic"]), **stated}
        ]:
            own = {
                constant: ply[member]
                for member, constant in _CONSTANTS.items()
                if ply.get(member) is not None
            }
            plies.append(
                Ply(_named(own, name, materials), ply["thickness_m"], ply.get("angle_deg", 0.0))
            )
        shells[name] = ShellSection(tuple(plies), Where(0))
    axes = {name: tuple(stated["axis"]) for name, stated in sections.items() if stated.get("axis")}
    held = {
        name: tuple(dof - 1 for dof in stated["held_dofs"])
        for name, stated in sections.items()
        if stated.get("held_dofs")
    }
    return MeshSets(shells, materials, axes, held)


def _named(constants: dict[str, float], name: str, materials: dict[str, Material]) -> str:
    """The name of a material, which is that of the first set of it."""
    if "E" in constants:
        constants["G"] = constants["E"] / (2 * (1 + constants["nu"]))
    same = next((each.name for each in materials.values() if each.constants == constants), None)
    if same is None:
        same = name if name not in materials else f"{name}_{len(materials) + 1}"
        materials[same] = Material(same, constants, Where(0))
    return same
