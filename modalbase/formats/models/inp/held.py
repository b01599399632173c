"""Constraints between nodes (rigid bodies, couplings, multi-point constraints, equations and ties),
and supports.

*BOUNDARY counts of the initial state and of steps up to that of the modes.
"""

import numpy as np
import scipy

from modalbase.formats.cell_types import CELL_TYPES
from modalbase.formats.models.check import nearness
from modalbase.formats.models.equations import Equation, Term
from modalbase.formats.models.inp.lines import DataLine, InpReport, Keyword, card_names, folded
from modalbase.formats.models.inp.mesh import InpMesh
from modalbase.formats.models.inp.orientations import Orientation, Part
from modalbase.formats.models.model import ALL_DOFS, Floats, Integers, Link, Support, Where

NAMES = card_names(
    "MPC RIGIDBODY COUPLING KINEMATIC DISTRIBUTING KINEMATICCOUPLING DISTRIBUTINGCOUPLING"
    " EQUATION TIE"
)


class Constraints:
    """Constraints as they are read.

    Attributes:
        links: nodes that others lead, but for equations.
        equations: of two terms and more.
        supports: dofs that an equation of one term holds.
        surfaces: cards *SURFACE with their parts, by scope and folded name.
    """

    def __init__(self, mesh: InpMesh, report: InpReport, axes: dict[int, Floats]) -> None:
        self.links: list[Link] = []
        self.supports: list[Support] = []
        self.equations: list[Equation] = []
        self.surfaces: dict[tuple[str, str], tuple[Keyword, Part]] = {}
        self._mesh, self._report, self._axes = mesh, report, axes
        self._places = np.array(mesh.places).reshape(-1, 3)
        self._near = nearness(self._places)
        self._coupling: Keyword | None = None

    def read(self, card: Keyword, part: Part) -> None:
        """Take a card of `NAMES`."""
        if card.name == "COUPLING":
            self._coupling = card
        elif card.name in ("KINEMATIC", "DISTRIBUTING"):
            self._surface_coupling(card, part)
        else:
            {
                "MPC": self._mpc,
                "RIGIDBODY": self._rigid_body,
                "KINEMATICCOUPLING": self._kinematic_coupling,
                "DISTRIBUTINGCOUPLING": self._distributing_coupling,
                "EQUATION": self._equations,
                "TIE": self._tie,
            }[card.name](card, part)

    def _one(self, name: str, part: Part, where: Keyword | DataLine) -> int:
        """A reference node, by number or by a set that has it alone."""
        nodes = part.nodes(name, where)
        if len(nodes) != 1:
            raise where.error(f"needs one node, and {name!r} has {len(nodes)}")
        return int(nodes[0])

    def _rigid(
        self,
        nodes: Integers,
        reference: int,
        dofs: tuple[int, ...],
        where: Where,
        system: Orientation | None = None,
    ) -> None:
        dependent = nodes[nodes != reference]
        axes = (
            [None] * len(dependent)
            if system is None or dofs == ALL_DOFS
            else system.at(self._places[dependent])
        )
        self.links += [
            Link(node, (reference,), dofs, where, axes=own)
            for node, own in zip(dependent.tolist(), axes, strict=True)
        ]

    def _mpc(self, card: Keyword, part: Part) -> None:
        for row in card.rows:
            kind, names = row.name_and_rest
            if kind.upper() not in ("BEAM", "TIE", "PIN") or len(names) != 2:
                self._report.note(row, "constraint_of_type", type=kind[:12].upper())
                continue
            dependent, independent = (part.nodes(name, row) for name in names)
            if len(independent) != 1:
                raise row.error(f"has {len(independent)} nodes that lead, expected one")
            reference = int(independent[0])
            dofs = ALL_DOFS[:3] if kind.upper() == "PIN" else ALL_DOFS
            apart = np.linalg.norm(self._places[dependent] - self._places[reference], axis=1)
            if kind.upper() != "BEAM" and np.any(apart > self._near):
                self._report.note(row, "nodes_apart", type=kind.upper())
                continue
            self._rigid(dependent, reference, dofs, row.where)

    def _rigid_body(self, card: Keyword, part: Part) -> None:
        reference = self._one(card.needs("REF NODE"), part, card)
        if card.get("ROT NODE"):
            self._report.note(card, "rot_node")
        if card.get("POSITION").upper() not in ("", "INPUT"):
            self._report.note(card, "moved_reference")
        for parameter, dofs in (
            ("ELSET", ALL_DOFS),
            ("NSET", ALL_DOFS),
            ("TIE NSET", ALL_DOFS),
            ("PIN NSET", ALL_DOFS[:3]),
        ):
            if not (name := card.get(parameter)):
                continue
            if parameter == "ELSET":
                every = {
                    node
                    for at in part.elements(name, card)
                    for node in self._mesh.elements[at].nodes
                }
                nodes = np.array(sorted(every), dtype=np.int64)
            else:
                nodes = part.nodes(name, card)
            self._rigid(nodes, reference, dofs, card.where)

    def _surface_coupling(self, card: Keyword, part: Part) -> None:
        coupling = self._coupling
        if coupling is None:
            raise card.error("stands before any *COUPLING, to which it would belong")
        reference = self._one(coupling.needs("REF NODE"), part, coupling)
        nodes = self._surface(coupling.needs("SURFACE"), part, coupling)
        if radius := coupling.get("INFLUENCE RADIUS"):
            near = np.linalg.norm(self._places[nodes] - self._places[reference], axis=1)
            limit = (
                np.inf
                if radius.upper() == "WORLD"
                else coupling.number(radius, "the influence radius")
            )
            nodes = nodes[near <= limit]
        nodes = nodes[nodes != reference]
        if not nodes.size:
            raise coupling.error("couples no node")
        system = part.system(coupling.get("ORIENTATION"), coupling)
        dofs = self._dofs(card)
        if card.name == "KINEMATIC":
            self._rigid(nodes, reference, dofs, coupling.where, system)
            return
        if card.get("WEIGHTING METHOD").upper() not in ("", "UNIFORM"):
            self._report.note(card, "weights_by_distance")
        axes = (
            None if system is None or dofs == ALL_DOFS else system.at(self._places[[reference]])[0]
        )
        self.links.append(Link(reference, tuple(nodes.tolist()), dofs, coupling.where, axes=axes))

    def _dofs(self, card: Keyword) -> tuple[int, ...]:
        """Of lines of first and last dof; all where there is none."""
        dofs: set[int] = set()
        for row in card.rows:
            fields = [text for text in row.fields if text]
            if fields:
                dofs |= set(dof_range(fields, row))
        return tuple(sorted(dofs)) or ALL_DOFS

    def _kinematic_coupling(self, card: Keyword, part: Part) -> None:
        reference = self._one(card.needs("REF NODE"), part, card)
        system = part.system(card.get("ORIENTATION"), card)
        for row in card.rows:
            name, rest = row.name_and_rest
            nodes = part.nodes(name, row)
            dofs = tuple(dof_range(rest, row)) if rest else ALL_DOFS
            self._rigid(nodes, reference, dofs, row.where, system)

    def _distributing_coupling(self, card: Keyword, part: Part) -> None:
        chosen = part.elements(card.needs("ELSET"), card)
        if len(chosen) != 1 or self._mesh.elements[chosen[0]].type.name != "DCOUP3D":
            raise card.error("needs one element of type DCOUP3D")
        weights: dict[int, float] = {}
        for row in card.rows:
            name, rest = row.name_and_rest
            weight = rest[0] if rest else "1"
            value = row.number(weight, "the weight")
            if not 0 < value < 1e12:
                raise row.error(f"has the weight {value:g}, expected one above 0")
            weights |= dict.fromkeys(part.nodes(name, row).tolist(), value)
        node = self._mesh.elements[chosen[0]].nodes[0]
        weights.pop(node, None)
        if not weights:
            raise card.error("couples no node")
        self.links.append(Link(node, tuple(weights), ALL_DOFS, card.where, tuple(weights.values())))

    def _equations(self, card: Keyword, part: Part) -> None:
        rows = iter(card.rows)
        for row in rows:
            terms = row.whole(row.fields[0] if row.fields else "", "the number of terms")
            if not 1 <= terms <= 100_000:
                raise row.error(f"has {terms} terms, expected at least 1")
            fields: list[str] = []
            while len(fields) < 3 * terms:
                following = next(rows, None)
                if following is None:
                    raise row.error(
                        f"has {len(fields) // 3} of {terms} terms of node, dof and coefficient; is"
                        " the file cut?"
                    )
                fields += following.fields[: 3 * terms - len(fields)] or [""]
            self._equation(row, [fields[k : k + 3] for k in range(0, 3 * terms, 3)], part)

    def _equation(self, row: DataLine, terms: list[list[str]], part: Part) -> None:
        """One of one term is a support. The first term's nodes each have one, with one node of every
        other term.
        """
        nodes = [part.nodes(term[0], row) for term in terms]
        dofs = [row.whole(term[1], "a dof") - 1 for term in terms]
        factors = [row.number(term[2], "a coefficient") for term in terms]
        if not all(0 <= dof <= 5 for dof in dofs) or any(len(some) > 1 for some in nodes[1:]):
            self._report.note(row, "equation")
            return
        if not factors[0]:
            raise row.error("begins with a coefficient of 0, expected that of the dof that depends")
        for first in nodes[0].tolist():
            chosen = [first, *(int(some[0]) for some in nodes[1:])]
            if len(terms) == 1:
                held = np.array([first])
                self.supports.append(Support(held, (dofs[0],), row.where, self._axes.get(first)))
            else:
                self.equations.append(Equation(row.where, list(map(Term, chosen, dofs, factors))))

    def _tie(self, card: Keyword, part: Part) -> None:
        """Nodes of the first surface that lie on nodes of the second depend on them."""
        for row in card.rows:
            names = row.fields
            if len(names) < 2:
                raise row.error("expected two surfaces: the one tied, and the one that leads")
            dependent, independent = (self._surface(name, part, row) for name in names[:2])
            pairs = self._coincident(dependent, independent)
            for node, other in pairs:
                self.links.append(Link(node, (other,), ALL_DOFS, row.where))
            if unmatched := len(set(dependent.tolist()) - set(independent.tolist())) - len(pairs):
                self._report.note(row, "tie", count=unmatched)

    def _coincident(self, dependent: Integers, independent: Integers) -> list[tuple[int, int]]:
        """Pairs of nodes at one place, each dependent one once; a node that is in both surfaces does not
        lead itself.
        """
        if not (dependent.size and independent.size):
            return []
        apart, at = scipy.spatial.cKDTree(self._places[independent]).query(
            self._places[dependent], k=2
        )
        pairs: dict[int, int] = {}
        for k, which in np.argwhere(apart <= self._near).tolist():
            if (other := int(independent[at[k, which]])) != dependent[k]:
                pairs.setdefault(int(dependent[k]), other)
        return list(pairs.items())

    def _surface(self, name: str, part: Part, where: Keyword | DataLine) -> Integers:
        """Nodes of a surface, or of a set of nodes."""
        inside, dot, last = folded(name).rpartition(".")
        scope = inside if dot and inside in self._mesh.scopes else part.scope
        surface = self.surfaces.get((scope, last if scope == inside else folded(name)))
        if surface is None:
            return part.nodes(name, where)
        card, part = surface
        nodes: set[int] = set()
        for row in card.rows:
            first, face = [*row.fields, "", ""][:2]
            if card.get("TYPE").upper() == "NODE":
                nodes |= set(part.nodes(first, row).tolist())
            else:
                for at in part.elements(first, row):
                    nodes |= set(self._face(at, face.upper(), row))
        return np.array(sorted(nodes), dtype=np.int64)

    def _face(self, at: int, face: str, row: DataLine) -> tuple[int, ...]:
        """Nodes of an element's face: all of a shell's, or those of its side E1 … E4 (S3 … S6 in
        CalculiX).
        """
        element = self._mesh.elements[at]
        if element.type.role != "shell" or face in ("", "SPOS", "SNEG", "S1", "S2", "POS", "NEG"):
            return element.nodes
        corners = CELL_TYPES[element.type.kind].corners
        side = {"E": -1, "S": -3}.get(face[:1])
        if side is None or not face[1:].isdigit() or not 0 <= (k := int(face[1:]) + side) < corners:
            raise row.error(f"names the face {face}, expected SPOS, SNEG or E1 to E{corners}")
        nodes = element.nodes
        return (nodes[k], nodes[(k + 1) % corners], *nodes[corners + k : corners + k + 1])


def dof_range(fields: list[str], row: DataLine) -> range:
    """Dofs from 0 of first and last."""
    first = row.whole(fields[0], "the first dof")
    last = row.whole(fields[1], "the last dof") if len(fields) > 1 and fields[1] else first
    if not 1 <= first <= last <= 6:
        raise row.error(f"names the dofs {first} to {last}, expected 1 ≤ first ≤ last ≤ 6")
    return range(first - 1, last)


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

Owned = tuple[Keyword, Part]


def step_of_modes(steps: list[list[Keyword]]) -> int:
    """Place of the first step with *FREQUENCY; the first where there is none."""
    return next(
        (k for k, step in enumerate(steps) if any(card.name == "FREQUENCY" for card in step)), 0
    )


def supports(
    initial: list[Owned],
    steps: list[list[Keyword]],
    whole: Part,
    axes: dict[int, Floats],
    report: InpReport,
) -> list[Support]:
    """What is held when modes are taken.

    A step keeps what those before it hold, and with OP=NEW only what it states itself.
    """
    held = list(initial)
    for step in steps[: step_of_modes(steps) + 1]:
        own = [(card, whole) for card in step if card.name == "BOUNDARY"]
        held = own if any(card.get("OP").upper() == "NEW" for card, _ in own) else held + own
    return [each for card, part in held for each in _of_card(card, part, axes, report)]


def _of_card(
    card: Keyword, part: Part, axes: dict[int, Floats], report: InpReport
) -> list[Support]:
    if "SUBMODEL" in card.parameters:
        report.note(card, "driven_motion")
        return []
    held: list[Support] = []
    for row in card.rows:
        name, rest = row.name_and_rest
        nodes = part.nodes(name, row)
        dofs = _dofs(rest, row, report)
        turned = [node for node in nodes.tolist() if node in axes and not _alike(dofs)]
        plain = nodes[~np.isin(nodes, turned)] if turned else nodes
        if dofs and plain.size:
            held.append(Support(plain, dofs, row.where))
        held += [Support(np.array([node]), dofs, row.where, axes[node]) for node in turned if dofs]
    return held


def _alike(dofs: tuple[int, ...]) -> bool:
    """Whether the same is held in any axes: all displacements or none, all turns or none."""
    return all(
        len([dof for dof in dofs if dof in group]) in (0, 3) for group in (range(3), range(3, 6))
    )


def _dofs(fields: list[str], row: DataLine, report: InpReport) -> tuple[int, ...]:
    if not fields:
        raise row.error("names no dof; expected ENCASTRE, PINNED or the first and last dof")
    if fields[0].upper() in _NAMED:
        return _NAMED[fields[0].upper()]
    if not fields[0].isdecimal():
        raise row.error(
            f"holds {fields[0][:20]!r}, expected {', '.join(_NAMED)}, or the first and last dof"
        )
    first = row.whole(fields[0], "the first dof")
    if first > 6:
        report.note(row, "dofs_above_6")
        return ()
    return tuple(dof_range(fields, row))


def note_prestress(steps: list[list[Keyword]], report: InpReport) -> None:
    """Note steps before that of the modes whose loads stiffen the structure, and later ones that
    ask for modes again.

    Abaqus counts them with NLGEOM, which CAE writes as NO where it is off; CalculiX where that of
    the modes has PERTURBATION.
    """
    modes = step_of_modes(steps)
    before = steps[:modes]
    nonlinear = any(step[0].parameters.get("NLGEOM", "NO").upper() != "NO" for step in before)
    plain = any("NLGEOM" in step[0].parameters for step in before) and not nonlinear
    for step in before:
        names = {card.name for card in step}
        if (
            names & GENERAL
            and names & _LOADS
            and (nonlinear or ("PERTURBATION" in steps[modes][0].parameters and not plain))
        ):
            report.note(step[0], "prestress")
    for card in (card for step in steps[modes + 1 :] for card in step if card.name == "FREQUENCY"):
        report.note(card, "later_step")
