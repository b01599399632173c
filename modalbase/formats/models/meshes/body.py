"""A mesh and what the user states of its sets, to the neutral model in SI."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modalbase.formats.cell_types import CELL_TYPES
from modalbase.formats.errors import FormatError
from modalbase.formats.meshes import Cells, MeshFile
from modalbase.formats.models.check import (
    ALONG_NORMAL,
    axis_without_system,
    check,
    normals_of,
    unit,
)
from modalbase.formats.models.meshes.cells import SOLID
from modalbase.formats.models.model import (
    Elements,
    FiniteElementModel,
    Floats,
    Integers,
    Material,
    ShellSection,
    SkippedCard,
    Support,
    Where,
    skipped_card,
)


@dataclass(frozen=True)
class MeshSets:
    """What a user says of a mesh, in SI."""

    sections: Mapping[str, ShellSection]  # of sets of shells
    materials: Mapping[str, Material]  # of these, by name
    # axis 1 of the material of sets, not projected; without one x, or z where x is the normal
    axes: Mapping[str, tuple[float, float, float]]
    # dofs (0 … 5) that are held of the nodes of sets of lines or points, or of shells
    held: Mapping[str, tuple[int, ...]]


def model_of_mesh(
    mesh: MeshFile, form: str, length_m: float, stated: MeshSets
) -> FiniteElementModel:
    """The model in SI. Nodes that no shell has are left out.

    Args:
        mesh: as it was read.
        form: of the file, such as `msh`.
        length_m: of the mesh's unit of length.
        stated: of its sets.

    Raises:
        FormatError: it has solids, or sets without a section, or such as have none are stated; or a
            shell has no area, folds over, lies on another, or hangs on nothing.
    """
    _refuse_solids(mesh)
    cells_by_set = _by_group(mesh, stated)
    shells = [cells for cells in cells_by_set if _is_shell(cells)]
    names = {cells.set for cells in mesh.cells} | {group.name for group in mesh.groups}
    _require_sections(shells, names, stated)
    used = (
        np.unique(np.concatenate([cells.nodes.ravel() for cells in shells]))
        if shells
        else np.zeros(0, dtype=np.int64)
    )
    rows = np.full(len(mesh.nodes), -1, dtype=np.int64)
    rows[used] = np.arange(len(used))
    places = np.asarray(mesh.nodes[used] * length_m, dtype=np.float64)
    nodes = {name: _held(rows, mesh, name) for name in sorted(names)}
    if lost := [name for name in stated.held if not nodes[name].size]:
        raise FormatError(f"sections.{lost[0]}", "holds nodes that no shell has")
    model = FiniteElementModel(
        format=form,
        title="",
        numbers=np.asarray(mesh.numbers[used], dtype=np.int64),
        nodes=places,
        elements=tuple(
            _elements(cells, rows, places, stated.axes.get(cells.set)) for cells in shells
        ),
        sections=dict(stated.sections),
        materials=dict(stated.materials),
        node_sets=nodes,
        supports=tuple(Support(nodes[name], dofs, Where(0)) for name, dofs in stated.held.items()),
        ignored=tuple(_lines_left(cells_by_set, stated.held)),
    )
    check(model)
    _require_one_layer(model)
    return model


def _first(cells: Cells) -> str:
    """The place of a set's first element."""
    return f"line {cells.lines[0]}" if cells.lines is not None and cells.lines[0] else ""


def _refuse_solids(mesh: MeshFile) -> None:
    if solids := [cells for cells in mesh.cells if cells.kind == SOLID]:
        named = ", ".join(f"{cells.set} ({len(cells.numbers)})" for cells in solids)
        raise FormatError(
            _first(solids[0]),
            f"the mesh has solid elements, which are not read: {named}. Send the matrices K and M"
            " that your solver makes of them, or the surfaces alone",
        )


def _require_sections(shells: Iterable[Cells], names: Collection[str], stated: MeshSets) -> None:
    kinds: dict[str, int] = {}
    for cells in shells:
        kinds[cells.set] = kinds.get(cells.set, 0) + len(cells.numbers)
    faults = [
        (
            f"sections.{name}",
            f"there is no such set; there are {', '.join(sorted(names)) or 'none'}",
        )
        for name in (*stated.sections, *stated.held)
        if name not in names
    ]
    faults += [
        (
            f"sections.{name}",
            "is of lines or points, which have no thickness; `held_dofs` can be said of them",
        )
        for name in stated.sections
        if name in names and name not in kinds
    ]
    if lacking := [
        f"{name} ({count} elements)" for name, count in kinds.items() if name not in stated.sections
    ]:
        faults.append(
            (
                "sections",
                (
                    f"lack {', '.join(lacking)}: state thickness_m and a material, or plies, of"
                    " each set of shells"
                ),
            )
        )
    if faults:
        raise FormatError(faults)


def _is_shell(cells: Cells) -> bool:
    return cells.kind.startswith(("tri", "quad"))


def _by_group(mesh: MeshFile, stated: MeshSets) -> Sequence[Cells]:
    """Cells whose set is the group that the user states something of, else the only one that they
    are in, else their own.

    Raises:
        FormatError: sections are stated of two sets or groups that a shell is in.
    """
    if not mesh.groups:
        return mesh.cells
    groups: defaultdict[int, list[str]] = defaultdict(list)
    for group in mesh.groups:
        for number in group.elements.tolist():
            groups[number].append(group.name)
    split = []
    for cells in mesh.cells:
        known = stated.sections if _is_shell(cells) else stated.held
        sets = []
        for number in cells.numbers.tolist():
            own = groups[number]
            named = [name for name in (*own, cells.set) if name in known]
            if len(named) > 1 and _is_shell(cells):
                both = " and ".join(named)
                raise FormatError(
                    f"sections.{named[1]}",
                    f"element {number} is in {both}; state the section of one",
                )
            sets.append((named or (own if len(own) == 1 else [cells.set]))[0])
        for name in dict.fromkeys(sets):
            at = np.array([one == name for one in sets])
            lines = None if cells.lines is None else cells.lines[at]
            split.append(
                replace(
                    cells, set=name, numbers=cells.numbers[at], nodes=cells.nodes[at], lines=lines
                )
            )
    return split


def _held(rows: Integers, mesh: MeshFile, name: str) -> Integers:
    """Rows of the nodes of a set or group that shells have."""
    parts = [cells.nodes.ravel() for cells in mesh.cells if cells.set == name]
    for group in mesh.groups:
        if group.name == name:
            parts += [
                group.nodes,
                *(c.nodes[np.isin(c.numbers, group.elements)].ravel() for c in mesh.cells),
            ]
    nodes = np.unique(rows[np.concatenate(parts)])
    return nodes[nodes >= 0]


def _elements(
    cells: Cells, rows: Integers, places: Floats, axis: tuple[float, float, float] | None
) -> Elements:
    nodes = rows[cells.nodes]
    normals = unit(normals_of(places[nodes[:, : CELL_TYPES[cells.kind].corners]]))
    lines = np.zeros(len(nodes), dtype=np.int64) if cells.lines is None else cells.lines
    if axis is None:
        axes = axis_without_system(normals)
    else:
        axes = np.broadcast_to(np.array(axis) / np.linalg.norm(axis), normals.shape)
        if np.any(bad := np.abs(np.einsum("ei,ei->e", axes, normals)) > ALONG_NORMAL):
            number = cells.numbers[int(np.argmax(bad))]
            raise FormatError(
                f"sections.{cells.set}.axis", f"lies along the normal of element {number}"
            )
    return Elements(cells.kind, cells.numbers, nodes, cells.set, axes, lines)  # type: ignore[arg-type]


def _lines_left(every: Iterable[Cells], held: Collection[str]) -> Iterable[SkippedCard]:
    """Lines that are no supports: they may be edges, or beams, whose stiffness would be missed."""
    for cells in every:
        if cells.kind.startswith("beam") and cells.set not in held:
            lines = () if cells.lines is None else tuple(cells.lines.tolist())
            yield skipped_card("lines_of_mesh", cells.set, lines, count=len(cells.numbers))


def _require_one_layer(model: FiniteElementModel) -> None:
    """Refuse two shells on the same nodes: a file states an element of two groups twice."""
    before: dict[bytes, tuple[int, str]] = {}
    for block in model.elements:
        for number, row in zip(block.numbers.tolist(), np.sort(block.nodes, axis=1), strict=True):
            other, name = before.setdefault(row.tobytes(), (number, block.set))
            if other != number or name != block.set:
                raise FormatError(
                    "",
                    f"elements {other} of the set {name} and {number} of the set {block.set} have"
                    " the same nodes",
                )
