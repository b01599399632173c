"""A structure as an engineer describes it, and how its model's coefficients follow from its
constants.

Its constants are those of its sections by set, `flange.E1`, `web.t`, and closed forms lead from
them to the coefficients c(q) and m(q) of its affine model (`fecore.body.constants.Body`). Sets that
share a material have a common prior.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.body.affine import distinct
from fecore.body.beams import BeamSection
from fecore.body.carried import KNOWN, mass_parts, spring_parts
from fecore.body.clamps import Bed, bed_of
from fecore.body.constants import Body, CommonPrior, Parameter, common_priors
from fecore.body.joints import NAIVE_ERROR, Joints
from fecore.body.junction_beams import between, joint_prefix, weighed
from fecore.body.junctions import Junction, encloses, find_junctions
from fecore.body.locate import TOLERANCE, Surfaces
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.model import Model, Part, assemble, idle, unresisted
from fecore.body.operators import Operators, beam_operators, shell_operators
from fecore.body.overlaps import Overlap, kept, overlap_correction
from fecore.body.sections import (
    INERTIAS,
    OF_INERTIAS,
    ShellSection,
    inertia_blocks,
    inertia_matrices,
)
from fecore.body.supports import (
    ALL_DOFS,
    Clamp,
    Link,
    Mass,
    NodeSpring,
    PointMass,
    Spring,
    Support,
    free_dofs,
    rigid_motions,
)
from fecore.errors import InputError
from fecore.quantities import is_signed, kind_of


@dataclass(frozen=True)
class Structure(Body):
    """A mesh with what makes it a body."""

    mesh: Mesh
    sections: Mapping[str, ShellSection | BeamSection]  # of each set
    supports: tuple[Support, ...] = ()  # what holds it
    # elastic supports; their stiffnesses can be updating parameters, by their names
    springs: tuple[Spring | NodeSpring, ...] = ()
    masses: tuple[Mass, ...] = ()  # what it carries
    links: tuple[Link, ...] = ()  # nodes that others lead
    # model junctions (`fecore.body.joints`); without, walls meet at their middle surfaces
    with_joints: bool = True
    # numbers of the dofs of a node; a flat strip needs w, θx, θy alone
    dofs: tuple[int, ...] = ALL_DOFS
    # nominal length, width and height along x, y and z of a body whose walls lie along these, with
    # axis 1 along x: they are constants then. Or the length alone, or length and width.
    size: tuple[float, ...] = ()
    clamps: tuple[Clamp, ...] = ()  # edges held by springs whose compliance is a constant
    # m along x, y and z by which a point may lie further from the surface than half the wall
    reach: tuple[float, float, float] = (TOLERANCE,) * 3

    def __post_init__(self) -> None:
        for block in self.mesh.blocks:
            if block.set not in self.sections:
                raise InputError(
                    "sections",
                    f"has none for the set {block.set}; there are {', '.join(self.sections)}",
                )
            if isinstance(self.sections[block.set], ShellSection) != block.is_shell:
                raise InputError(
                    "sections", f"of the set {block.set} is not one of {block.kind} elements"
                )

    @cached_property
    def nominal(self) -> dict[str, float]:
        """Constants by name, SI."""
        nominal = {
            f"{name}.{c}": v
            for name in self.mesh.sets
            for c, v in self.sections[name].nominal.items()
        }
        nominal |= dict(zip(SIZES, self.size, strict=False))
        return nominal | {clamp.name: clamp.compliance for clamp in self.clamps}

    @property
    def junctions(self) -> tuple[Junction, ...]:
        """Where walls were found to meet."""
        return self.model.joints.junctions

    @cached_property
    def model_error(self) -> float:
        """Relative error of a natural frequency by the model of joints, independent from mode to
        mode; 0 without any.

        Where walls meet at their middle surfaces it is 1.6 %, of lines at which two walls turn by
        less than a right angle as much less as they turn less.
        """
        if not self.with_joints:
            lines = find_junctions(self.mesh, self._thickness) if len(self.dofs) == 6 else ()
            return max(
                (NAIVE_ERROR * edge.corner.turn for line in lines for edge in line.edges),
                default=0.0,
            )
        if not (junctions := self.junctions):
            return 0.0
        return self.model.joints.frequency_error(hard=encloses(self.mesh, junctions))

    @property
    def _thickness(self) -> dict[str, float]:
        return {
            name: part.thickness
            for name, part in self.sections.items()
            if isinstance(part, ShellSection)
        }

    @property
    def in_space(self) -> Structure:
        """Itself."""
        return self

    @property
    def bed(self) -> Bed | None:
        """The bed of its clamp; None where anything but one clamp holds it."""
        return bed_of(self)

    def carrying(self, masses: Sequence[PointMass]) -> Self:
        """The body with more masses."""
        return replace(self, masses=(*self.masses, *(mass.on_surface() for mass in masses)))

    def default_parameters(self) -> tuple[Parameter, ...]:
        """Moduli of each set, those of an isotropic material as one."""
        return tuple(
            each.of_set(name)
            for name in self.mesh.sets
            for each in self.sections[name].default_parameters()
        )

    def common_priors(self) -> tuple[CommonPrior, ...]:
        """Moduli of sets whose first materials are nominally alike, as constants of one
        material.
        """
        shells = {
            name: section.materials[0]
            for name in self.mesh.sets
            if isinstance(section := self.sections[name], ShellSection)
        }
        return common_priors(shells)

    @cached_property
    def model(self) -> Model:
        """The affine finite element model, which holds for any constants.

        Raises:
            InputError: the place of a support, spring or mass is wrong, or a spring acts on nothing
                that can move.
        """
        joints, surfaces = self._joints, self.surfaces
        parts = [*self._walls(joints), *self._junction_beams(joints)]
        held = (*(clamp.spring for clamp in self.clamps), *self.springs)
        springs = self._linked(spring_parts(self.mesh, surfaces, held))
        stiffness = [*self._linked([one for some, _ in parts for one in some]), *springs]
        mass = self._linked(
            [*(one for _, some in parts for one in some), *mass_parts(surfaces, self.masses)]
        )
        used = np.unique(
            np.concatenate([part.operators.nodes.ravel() for part in (*stiffness, *mass)])
        )
        free = free_dofs(self.mesh, self.supports, used, self.dofs, self.links)
        K, M = assemble(stiffness, mass, free, self.dofs)
        for spring in held:
            if spring.name not in K.names or not K.term(K.names.index(spring.name)).data.any():
                raise InputError(
                    "spring", f"{spring.name} acts on nothing that moves in this model"
                )
        motions = rigid_motions(self.mesh.nodes, self.links)[:, list(self.dofs)]
        rigid = unresisted(motions, used, free, K, len(K.names) - len(held))
        unused = idle(K, M)
        if unused.any():
            rigid, left = rigid[~unused], free.copy()
            left[free] = ~unused
            K, M = assemble(stiffness, mass, left, self.dofs)
        return Model(
            self.mesh,
            joints,
            surfaces,
            self.dofs,
            stiffness=K,
            mass=M,
            rigid_modes=rigid,
            links=self.links,
        )

    @cached_property
    def surfaces(self) -> Surfaces:
        """The shells and beams as they lie in space, on which points are found."""
        walls = [
            (s.thickness, s.offset) if isinstance(s, ShellSection) else (2 * s.reach, 0.0)
            for s in self._sections
        ]
        shifts = [
            shift if isinstance(s, ShellSection) else shift + np.array(s.offset)
            for shift, s in zip(self._joints.shifts, self._sections, strict=True)
        ]
        thickness, offsets = zip(*walls, strict=True)
        return Surfaces(self.mesh, tuple(shifts), thickness, offsets, self.reach)

    @cached_property
    def _joints(self) -> Joints:
        axes = {name: section.axis for name, section in self.sections.items()}
        folded = self.with_joints and len(self.dofs) == 6  # with fewer dofs a body is flat
        return Joints(self.mesh, find_junctions(self.mesh, self._thickness) if folded else (), axes)

    @property
    def _sections(self) -> list[ShellSection | BeamSection]:
        """The section of each block."""
        return [self.sections[block.set] for block in self.mesh.blocks]

    def _walls(self, joints: Joints) -> Iterator[tuple[list[Part], list[Part]]]:
        """Stiffness and mass of each block."""
        for block, shift, overlap in zip(
            self.mesh.blocks, joints.shifts, joints.overlaps, strict=True
        ):
            section = self.sections[block.set]
            if isinstance(section, ShellSection):
                strains, motions, drilling = shell_operators(
                    block, self.mesh.nodes, shift, section, ALL_DOFS[-1] in self.dofs
                )
                one = np.ones((1, 1, 1)), (f"{block.set}.drilling",), _ONE
                stiffness = [] if drilling is None else [Part(drilling, *one)]
                stiffness += self._corrections(strains, block, overlap)
                motions = kept(motions, block, overlap)
                motion = Part(
                    motions, inertia_matrices(), _named(block.set, INERTIAS), inertia_blocks()
                )
            else:
                arm = shift + np.array(section.offset)
                axis = np.array(section.axis) if block.axes is None else block.axes
                strains, motions = beam_operators(
                    block.nodes, block.kind, self.mesh.nodes, axis, arm
                )
                stiffness = []
                names = _named(block.set, section.motions)
                motion = Part(motions, section.mass_matrices, names, section.motion_blocks)
            stiffness.insert(
                0, Part(strains, section.matrices, _named(block.set, section.terms), section.blocks)
            )
            yield stiffness, [motion]

    def _corrections(
        self, strains: Operators, block: CellBlock, overlap: Overlap
    ) -> Iterator[Part]:
        """What is taken from the stiffness of a block's elements where other walls are."""
        if not len(overlap.elements):
            return
        rows = overlap_correction(
            strains, block, self.mesh.nodes, overlap, np.array(self.sections[block.set].axis)
        )
        which, degrees, share = between(overlap.angles, overlap.turns)
        for angle in np.unique(degrees).tolist():
            own = degrees == angle
            some = rows[which[own]] * np.sqrt(share[own])[:, None, None, None, None]
            chosen, again = distinct(some)
            operators = Operators(block.nodes[overlap.elements[which[own]]], again, some[chosen])
            names = _named(joint_prefix(block.set, angle), _STRIP)
            yield Part(operators, -_STRIP_MATRICES, names, (np.array([[0, 1], [1, 2]]),))

    def _junction_beams(self, joints: Joints) -> Iterator[tuple[list[Part], list[Part]]]:
        """Stiffness and mass of the joints' beams, set by set."""
        one = np.eye(6)[None]
        for lines in joints.junction_beams:
            kind = f"beam{lines.nodes.shape[1]}"
            strains, motions = beam_operators(lines.nodes, kind, self.mesh.nodes, lines.axes)
            for rank, angle, beams, stiffness, mass in lines.by_set:
                prefix, nodes = joint_prefix(self.mesh.sets[rank], angle), lines.nodes[beams]
                K, M = (
                    [
                        Part(
                            weighed(rows, nodes, beams, forms[:, k]),
                            one,
                            (f"{prefix}.{name}",),
                            _ONE,
                        )
                        for k, name in enumerate(names)
                    ]
                    for rows, forms, names in (
                        (strains, stiffness, ("E", "G", "Gt")),
                        (motions, mass, _DENSITIES),
                    )
                )
                yield K, M

    def _linked(self, parts: list[Part]) -> list[Part]:
        """Parts with dependent nodes replaced by their independent ones."""
        links = {link.node: link for link in self.links}
        if not links:
            return parts
        return [
            Part(operators, part.terms, part.names, part.blocks)
            for part in parts
            for operators in part.operators.linked(links, self.mesh.nodes)
        ]

    def _of(self, constants: FloatArray) -> dict[str, dict[str, FloatArray]]:
        """Constants by set and name."""
        by_set: dict[str, dict[str, FloatArray]] = {}
        for name, value in zip(self.nominal, constants, strict=True):
            set_name, _, constant = name.rpartition(".")
            by_set.setdefault(set_name, {})[constant] = value
        return by_set

    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(k, …) coefficients of the model's stiffness, springs apart, from (c, …) constants in the
        order of `nominal`.
        """
        of = self._of(constants)
        values: dict[str, FloatArray] = {}
        for name in self.mesh.sets:
            section = self.sections[name]
            if isinstance(section, ShellSection):
                terms = section.coefficients(of[name], bending_only=not {0, 1} & set(self.dofs))
                values |= dict(zip(_named(name, (*section.terms, "drilling")), terms, strict=True))
            else:
                values |= dict(
                    zip(_named(name, section.terms), section.coefficients(of[name]), strict=True)
                )
        for name, angle in self._joint_walls:
            along = self._shell(name).along(of[name], np.radians(angle))
            values |= dict(
                zip(
                    _named(joint_prefix(name, angle), ("E", "G", "Gt", *_STRIP)), along, strict=True
                )
            )
        values |= {clamp.name: clamp.spring.stiffness / of[""][clamp.name] for clamp in self.clamps}
        names = self.model.stiffness.names
        return self._stretched(names[: len(names) - len(self.springs)], values, of.get("", {}))

    def mass_coefficients(self, constants: FloatArray) -> FloatArray:
        """(j, …) coefficients of the model's mass."""
        of, one = self._of(constants), np.ones_like(constants[0])
        values = {KNOWN: one, **{mass.name: one for mass in self.masses}}
        for name in self.mesh.sets:
            section = self.sections[name]
            if isinstance(section, ShellSection):
                inertia = section.inertia(of[name])
                values |= dict(zip(_named(name, INERTIAS), inertia[list(OF_INERTIAS)], strict=True))
            else:
                values |= dict(
                    zip(_named(name, section.motions), section.inertias(of[name]), strict=True)
                )
        for name, angle in self._joint_walls:
            values |= dict.fromkeys(
                _named(joint_prefix(name, angle), _DENSITIES), of[name]["density"]
            )
        return self._stretched(self.model.mass.names, values, of.get("", {}))

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) whether moduli, densities and dimensions are positive and plane-stress stiffnesses
        positive definite; a density that is nominally 0 may be.
        """
        names = list(self.nominal)
        signed = np.array([is_signed(name) or not value for name, value in self.nominal.items()])
        good = np.all(constants[~signed] > 0, axis=0)
        for row, name in enumerate(names):
            if kind_of(name) == "nu12":
                E1, E2 = (constants[names.index(name.replace("nu12", E))] for E in ("E1", "E2"))
                good = good & (constants[row] ** 2 * E2 < 0.99 * E1)
        return np.asarray(good)

    @cached_property
    def _joint_walls(self) -> tuple[tuple[str, int], ...]:
        sets = self.mesh.sets
        walls = {
            (sets[rank], angle)
            for lines in self.model.joints.junction_beams
            for rank, angle, *_ in lines.by_set
        }
        return tuple(sorted(walls))

    def _shell(self, name: str) -> ShellSection:
        section = self.sections[name]
        assert isinstance(section, ShellSection)
        return section

    def _stretched(
        self,
        names: tuple[str, ...],
        values: Mapping[str, FloatArray],
        whole: Mapping[str, FloatArray],
    ) -> FloatArray:
        """Values by name of a body whose mesh has the nominal dimensions.

        Where x = αx', y = βy', z = γz', take u' = αu, v' = βv, w' = γw, and θx' = βγθx and so on.
        Then the strains of the stretched body are those of the mesh times powers of the stretches
        along a wall's axes 1 and 2 and its normal. Walls keep their thickness. (Joints follow the
        length alone, and masses at points move a little too much.)
        """
        ratios = [whole[name] / size for name, size in zip(SIZES, self.size, strict=False)]
        rows = {name: values[name] for name in names}
        for name in names if ratios else ():
            for axis, power in self._powers_by_name[name]:
                rows[name] = rows[name] * ratios[axis] ** power
        return np.array([rows[name] for name in names])

    @cached_property
    def _powers_by_name(self) -> dict[str, list[tuple[int, int]]]:
        """The powers of the stretches along x, y and z in each coefficient of the model."""
        powers = {}
        for name in (*self.model.stiffness.names, *self.model.mass.names):
            set_name, _, last = name.rpartition(".")
            axes = self._axes.get(set_name.removesuffix(".joint"), (0, 1, 2))
            along = zip(axes, _powers(last), strict=True)
            powers[name] = [(x, n) for x, n in along if n and x < len(self.size)]
        return powers

    @cached_property
    def _axes(self) -> dict[str, tuple[int, int, int]]:
        """Of each set of shells, which of x, y and z its axes 1 and 2 and its normal lie along.

        Raises:
            InputError: a wall lies askew, so that the body cannot be stretched.
        """
        axes_of = {}
        for name, axes in axes_of_walls(self.mesh).items():
            if axes is None:
                raise InputError(
                    "size", f"of a body whose set {name} does not lie along x and y or x and z"
                )
            axes_of[name] = axes
        return axes_of


def axes_of_walls(mesh: Mesh) -> dict[str, tuple[int, int, int] | None]:
    """Of each set of shells, which of x, y and z axis 1 (x), axis 2 and the normal lie along; None
    where the set lies askew.
    """
    axes: dict[str, tuple[int, int, int] | None] = {}
    for block in mesh.blocks:
        if block.is_shell:
            flat = [
                axis
                for axis in (1, 2)
                if not np.ptp(mesh.nodes[block.nodes][..., axis], axis=1).max() > 1e-9
            ]
            own = (0, 3 - flat[0], flat[0]) if flat else None
            axes[block.set] = own if axes.setdefault(block.set, own) == own else None
    return axes


SIZES = ("length", "width", "height")
"""Constants of a body that can be stretched along x, y and z."""


def _powers(name: str) -> tuple[int, int, int]:
    """Of the stretches along axis 1, axis 2 and the normal in a coefficient: A11, I0_1, or E of a
    joint.
    """
    if name in _ALONG:
        return _ALONG[name], 0, 0
    if name[0] in "ABD":
        return *_PLANE[name[1:]], -"ABD".index(name[0])
    return _OTHERS.get(name, (0, 0, 0))


_STRIP = ("A11", "B11", "D11")
_STRIP_MATRICES = np.array([[[1.0, 0], [0, 0]], [[0, 1], [1, 0]], [[0, 0], [0, 1]]])
"""Coefficients of a wall as a beam along a line, on stretch and curvature."""

_DENSITIES = ("density_x", "density_y", "density_z")
"""Coefficients of a junction beam's mass, of which each has motion along one axis."""

_PLANE = {
    "11": (-3, 1),
    "12": (-1, -1),
    "22": (1, -3),
    "66": (-1, -1),
    "16": (-2, 0),
    "26": (0, -2),
}
_OTHERS = {
    "S55": (-1, 1, -2),
    "S44": (1, -1, -2),
    "S45": (0, 0, -2),
    "drilling": (-1, -1, 0),
    **{
        f"I{n}_{axis}": (*power, -n)
        for n in (0, 1, 2)
        for axis, power in ((1, (-1, 1)), (2, (1, -1)))
    },
    **dict(zip(_DENSITIES, ((-1, 0, 0), (1, -2, 0), (1, 0, -2)), strict=True)),
    **{f"I{n}_3": (1, 1, -2) for n in (0, 1, 2)},
}
_ALONG = {
    **dict.fromkeys(("E", "EA", "EI1", "EI2", "EI12"), -3),
    **dict.fromkeys(("G", "Gt", "GA1", "GA2", "GJ", "m_1", "mI1", "mI2", "mI12"), -1),
    **dict.fromkeys(("m", "mJ"), 1),
}

_ONE = (np.array([[0]]),)


def _named(prefix: str, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{prefix}.{name}" for name in names)
