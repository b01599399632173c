"""Supports: *BOUNDARY of the initial state and of steps up to that of the modes."""

from __future__ import annotations

import numpy as np

from modalbase.formats.models.inp.constraints import dof_range
from modalbase.formats.models.inp.lines import Card, Row
from modalbase.formats.models.inp.losses import Losses
from modalbase.formats.models.inp.mesh import Mesh
from modalbase.formats.models.model import Floats, Support

_NAMED = {
    "ENCASTRE": (0, 1, 2, 3, 4, 5),
    "PINNED": (0, 1, 2),
    "XSYMM": (0, 4, 5),
    "YSYMM": (1, 3, 5),
    "ZSYMM": (2, 3, 4),
    "XASYMM": (1, 2, 3),
    "YASYMM": (0, 2, 4),
    "ZASYMM": (0, 1, 5),
}
_LOADS = frozenset(["CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE"])
GENERAL = frozenset(["STATIC", "VISCO", "DYNAMIC", "COUPLEDTEMPERATURE-DISPLACEMENT"])

Scoped = tuple[Card, str]


def step_of_modes(steps: list[list[Card]]) -> int:
    """Place of the first step with *FREQUENCY; the first where there is none."""
    return next((k for k, step in enumerate(steps) if any(card.name == "FREQUENCY" for card in step)), 0)


def supports(
    initial: list[Scoped], steps: list[list[Card]], mesh: Mesh, axes: dict[int, Floats], losses: Losses
) -> list[Support]:
    """What is held when modes are taken.

    A step keeps what those before it hold, and with OP=NEW only what it states itself.
    """
    held = list(initial)
    for step in steps[: step_of_modes(steps) + 1]:
        own = [(card, "") for card in step if card.name == "BOUNDARY"]
        held = own if any(card.get("OP").upper() == "NEW" for card, _ in own) else held + own
    return [each for card, scope in held for each in _of_card(card, scope, mesh, axes, losses)]


def _of_card(card: Card, scope: str, mesh: Mesh, axes: dict[int, Floats], losses: Losses) -> list[Support]:
    if "SUBMODEL" in card.parameters:
        losses.note(card, "motion that another model prescribes", changes=True)
        return []
    found: list[Support] = []
    for row in card.rows:
        name, rest = row.parted
        nodes = mesh.select_nodes(name, scope, row)
        dofs = _dofs(rest, row, losses)
        turned = [node for node in nodes.tolist() if node in axes and not _alike(dofs)]
        plain = nodes[~np.isin(nodes, turned)] if turned else nodes
        if dofs and plain.size:
            found.append(Support(plain, dofs, row.line))
        found += [Support(np.array([node]), dofs, row.line, axes[node]) for node in turned if dofs]
    return found


def _alike(dofs: tuple[int, ...]) -> bool:
    """Whether the same is held in any axes: all displacements or none, all turns or none."""
    return all(len([dof for dof in dofs if dof in group]) in (0, 3) for group in (range(3), range(3, 6)))


def _dofs(fields: list[str], row: Row, losses: Losses) -> tuple[int, ...]:
    if not fields:
        raise row.error("names no dof; expected ENCASTRE, PINNED or the first and last dof")
    if fields[0].upper() in _NAMED:
        return _NAMED[fields[0].upper()]
    if not fields[0].isdecimal():
        raise row.error(f"holds {fields[0][:20]!r}, expected {', '.join(_NAMED)}, or the first and last dof")
    first = row.whole(fields[0], "the first dof")
    if first > 6:
        losses.note(row, "dofs above 6, such as temperature", changes=False)
        return ()
    return tuple(dof_range(fields, row))


def note_prestress(steps: list[list[Card]], losses: Losses) -> None:
    """Note steps before that of the modes whose loads stiffen the structure.

    Abaqus counts them with NLGEOM, which CAE writes as NO where it is off; CalculiX where that of the modes has PERTURBATION.
    """
    modes = step_of_modes(steps)
    before = steps[:modes]
    nonlinear = any(step[0].says("NLGEOM") or step[0].parameters.get("NLGEOM") == "" for step in before)
    plain = any("NLGEOM" in step[0].parameters for step in before) and not nonlinear
    for step in before:
        names = {card.name for card in step}
        if (
            names & GENERAL
            and names & _LOADS
            and (nonlinear or ("PERTURBATION" in steps[modes][0].parameters and not plain))
        ):
            losses.note(step[0], "a state of stress before the modes, which stiffens or softens", changes=True)
