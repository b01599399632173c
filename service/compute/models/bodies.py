"""From a model in SI to the core's body.

What the core has no word for is said in its own: mass that is no structure's is density, a beam
that is rigid in shear has a shear area a thousand times its area, springs of one stiffness are one
parameter.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import takewhile

import numpy as np

from fecore.arrays import FloatArray
from fecore.body import beams, sections
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.laminate import Ply as CorePly
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.structure import Structure, axes_of_walls
from fecore.body.supports import DISPLACEMENTS, Link, Mass, NodeSpring, Support
from fecore.errors import InputError
from modalbase.formats.models import model as formats
from modalbase.formats.models.check import free_motions, mean_thickness
from modalbase.formats.models.model import (
    BeamSection,
    Elements,
    FiniteElementModel,
    Material,
    ShellSection,
    Spring,
)

AS_MODELLED = "as_modelled"  # the boundary of a campaign that held the body as the model says
RIGID_SHEAR = 1e3  # shear factor of a beam that its deck has rigid in shear


def body_of_model(model: FiniteElementModel, boundary: str = "free") -> Structure:
    """The core's body.

    Args:
        model: in SI.
        boundary: `free`, or `as_modelled` with the model's own supports and springs to the ground.

    Raises:
        InputError: the boundary is another, or two supports hold a node along different axes.
    """
    if boundary not in ("free", AS_MODELLED):
        raise InputError(
            "boundary",
            f"is {boundary}, but this structure is a model of its own: free, or as_modelled with"
            " its supports",
        )
    held = boundary == AS_MODELLED
    stated = model.supports if held else ()
    turned = _turned(stated, model.links)
    links = [Link(m.node, m.leaders, m.dofs, m.weights, m.axes, m.equations) for m in model.links]
    dependent = {link.node for link in links}
    supports = {
        f"support {k} of {s.where}": (
            s.nodes[~np.isin(s.nodes, [*(dependent & turned.keys())])],
            _held_dofs(s),
        )
        for k, s in enumerate(stated, start=1)
        if not _is_askew(s)
    }
    for node, (axes, dofs) in turned.items():
        if node in dependent:
            supports[f"support of led node {node}"] = (
                np.array([node]),
                tuple(DISPLACEMENTS[dof] for dof in dofs),
            )
        else:
            links.append(Link(node, (), dofs, axes=axes))
    mesh = Mesh(
        model.nodes,
        tuple(_block(each, model) for each in model.elements),
        {**model.node_sets, **{name: nodes for name, (nodes, _) in supports.items()}},
    )
    return Structure(
        mesh,
        {name: section_of(model, name) for name in model.sets},
        tuple(Support(name, dofs) for name, (nodes, dofs) in supports.items() if nodes.size),
        _springs(model, held=held),
        tuple(Mass(m.mass, m.node, m.inertia, m.offset) for m in model.masses),
        tuple(links),
        size=_size(model, mesh),
    )


def _size(model: FiniteElementModel, mesh: Mesh) -> tuple[float, ...]:
    """Length, width and height of walls that lie along x, with their axis 1, and along y or z: they
    are inputs then; else none.

    Beams and rigid links would have to be stretched too.
    """
    axes = np.concatenate([each.axes for each in model.elements])
    along = np.abs(axes[:, 0]) > (1 - 1e-9) * np.linalg.norm(axes, axis=1)
    if (
        model.links
        or not along.all()
        or not all(b.is_shell for b in mesh.blocks)
        or None in axes_of_walls(mesh).values()
    ):
        return ()
    whole = np.ptp(
        mesh.nodes[np.unique(np.concatenate([block.nodes.ravel() for block in mesh.blocks]))],
        axis=0,
    )
    return tuple(takewhile(bool, whole.tolist()))


def section_of(model: FiniteElementModel, name: str) -> sections.ShellSection | beams.BeamSection:
    """The core's section of a set."""
    section = model.sections[name]
    axis = _first_axis(model, name)
    if isinstance(section, BeamSection):
        return _beam(section, model.materials[section.material], axis)
    return _shell(section, model, axis, mean_thickness(model, name))


def _first_axis(model: FiniteElementModel, name: str) -> tuple[float, float, float]:
    x, y, z = next(each.axes[0] for each in model.elements if each.set == name).tolist()
    return x, y, z


def _shell(
    section: ShellSection,
    model: FiniteElementModel,
    axis: tuple[float, float, float],
    thickness: float,
) -> sections.ShellSection:
    """The section with its mean thickness, to which the elements' own are relative."""
    extra, plies = section.extra_mass / thickness, []
    share = thickness / sum(ply.thickness for ply in section.plies)
    for ply in section.plies:
        own = orthotropic(model.materials[ply.material])
        plies.append(
            CorePly(replace(own, density=own.density + extra), share * ply.thickness, ply.angle_deg)
        )
    return sections.ShellSection(tuple(plies), axis, section.offset)


def _beam(
    section: BeamSection, material: Material, axis: tuple[float, float, float]
) -> beams.BeamSection:
    own = orthotropic(material)
    return beams.BeamSection(
        E=own.Ex,
        G=own.Gxz,
        density=own.density + section.extra_mass / section.area,
        area=section.area,
        inertia=section.inertia,
        torsion=section.torsion,
        shear=section.shear or (RIGID_SHEAR, RIGID_SHEAR),
        axis=axis,
    )


def orthotropic(material: Material) -> OrthotropicMaterial:
    """The core's material."""
    c = material.constants
    if material.is_isotropic:
        c = {
            **c,
            "nu12": c["nu"],
            **dict.fromkeys(("E1", "E2"), c["E"]),
            # G may differ from it, of decks that state all three
            "G12": c["E"] / (2 * (1 + c["nu"])),
            **dict.fromkeys(("G13", "G23"), c["G"]),
        }
    return OrthotropicMaterial(
        Ex=c["E1"],
        Ey=c["E2"],
        Gxy=c["G12"],
        Gxz=c["G13"],
        Gyz=c["G23"],
        nu_xy=c["nu12"],
        density=c["density"],
    )


def _block(elements: Elements, model: FiniteElementModel) -> CellBlock:
    section = model.sections[elements.set]
    thickness = elements.thickness
    if thickness is not None and isinstance(section, ShellSection):
        thickness = thickness / mean_thickness(model, elements.set)
    same = np.allclose(elements.axes, _first_axis(model, elements.set), rtol=0, atol=1e-9)
    axes = None if same else elements.axes
    return CellBlock(elements.kind, elements.nodes, elements.set, thickness, axes, elements.offsets)


def _held_dofs(support: formats.Support) -> tuple[str, ...]:
    """Names of dofs that are held by a support along the model's axes, in some order."""
    dofs, axes = support.dofs, support.axes
    if axes is not None and not _is_whole(dofs):
        dofs = tuple(sorted(3 * (dof // 3) + int(np.argmax(np.abs(axes[dof % 3]))) for dof in dofs))
    return tuple(DISPLACEMENTS[dof] for dof in dofs)


def _is_whole(dofs: tuple[int, ...]) -> bool:
    """Whether all displacements are held or none, and all turns or none: along whatever axes."""
    return all(len({*dofs} & {first, first + 1, first + 2}) in (0, 3) for first in (0, 3))


def _is_askew(support: formats.Support) -> bool:
    """Whether it holds some directions of axes that are not the model's in some order."""
    return support.axes is not None and not _is_whole(support.dofs) and not _permutes(support.axes)


def _turned(
    supports: Sequence[formats.Support], links: Sequence[formats.Link]
) -> dict[int, tuple[FloatArray, tuple[int, ...]]]:
    """Axes and dofs of nodes that are held along axes of their own, with all that holds them; of a
    led node its link's axes.

    Raises:
        InputError: two hold a node along different axes.
    """
    axes = {
        node: _axes(support)
        for support in filter(_is_askew, supports)
        for node in support.nodes.tolist()
    }
    axes |= {link.node: _axes(link) for link in links if link.axes is not None or link.node in axes}
    held: dict[int, set[int]] = {node: set() for node in axes}
    for support in supports:
        for node in held.keys() & set(support.nodes.tolist()):
            if not _is_whole(support.dofs) and not np.allclose(
                axes[node], _axes(support), rtol=0, atol=1e-9
            ):
                raise InputError(
                    "boundary",
                    f"as_modelled: the support of {support.where} holds a node along other axes"
                    " than another support; state them along the same",
                )
            held[node] |= set(support.dofs)
    return {node: (axes[node], tuple(sorted(dofs))) for node, dofs in held.items() if dofs}


def _axes(of: formats.Support | formats.Link) -> FloatArray:
    """(3, 3) as rows, along which its dofs are."""
    return np.eye(3) if of.axes is None else of.axes


def _permutes(axes: FloatArray) -> bool:
    """Whether axes lie along those of the model, in some order."""
    return bool(np.all(np.abs(axes).max(axis=1) > 1 - 1e-9))


def _springs(model: FiniteElementModel, *, held: bool) -> tuple[NodeSpring, ...]:
    """Springs of one stiffness and of one number of nodes together; those to the ground where the
    body is held.

    One of no stiffness, or whose ends are held along it, acts on nothing.
    """
    ends = {
        node
        for spring in model.springs
        for node in (spring.node, spring.second)
        if node is not None
    }
    free = free_motions(model.supports if held else (), ends)
    groups: dict[tuple[float, int], list[Spring]] = defaultdict(list)
    for spring in model.springs:
        count = 1 if spring.second is None else 2
        acts = any(
            np.abs(row @ free[node]).max(initial=0.0) > 1e-9 * np.abs(row).max()
            for node, row in zip((spring.node, spring.second), _stretch(spring), strict=True)
            if node is not None
        )
        if spring.stiffness and (held or count == 2) and acts:
            groups[spring.stiffness, count].append(spring)
    return tuple(
        NodeSpring(
            f"spring {k} of {members[0].where}",
            stiffness,
            np.array([[s.node, s.second][:count] for s in members], dtype=np.int64),
            np.array([_stretch(s)[:count] for s in members]),
        )
        for k, ((stiffness, count), members) in enumerate(groups.items(), start=1)
    )


def _stretch(spring: Spring) -> FloatArray:
    """(2, 6) what stretches or turns a spring, by the motions of its ends.

    At an arm r it stretches by n · (u + θ × r) = n · u + θ · (r × n).
    """
    rows = np.zeros((2, 6))
    for row, dof, sign in ((0, spring.dof, 1.0), (1, spring.second_dof, -1.0)):
        if dof is None:
            continue
        n = sign * (np.eye(3)[dof % 3] if spring.direction is None else np.array(spring.direction))
        if dof >= 3:
            rows[row, 3:] = n
            continue
        rows[row, :3] = n
        if spring.arms is not None:
            rows[row, 3:] = np.cross(spring.arms[row], n)
    return rows
