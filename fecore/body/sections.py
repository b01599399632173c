"""Sections of shells: constants of plies to coefficients, in closed form.

A section belongs to a set of elements. Its constants q are those of its materials in their own
axes, its density and its thickness; its coefficients c(q) are the entries of A, B, D and S
(`fecore.body.laminate`) and of the drilling, γ A66. The closed forms take complex constants too, so
that their derivatives are complex steps.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fecore.arrays import ROUND_OFF, FloatArray, IntArray
from fecore.body.constants import Parameter, of_plies
from fecore.body.laminate import (
    SHEAR_CORRECTION,
    AlongNormal,
    OrthotropicMaterial,
    Ply,
    along_normal,
    balanced_shear,
)
from fecore.errors import InputError

PLY_CONSTANTS = ("E1", "E2", "G12", "G13", "G23", "nu12")
"""Constants of a material in its own axes; those of a second material from the bottom are E1_2 and
so on.
"""

DRILLING = 0.01
"""γ: stiffness of the rotation about the normal by A66. From 1e-4 to 1e-2 frequencies agree within
.01 %; 1 adds .3 %.
"""

DRILLING_INERTIA = 0.1
"""Inertia about the normal by I2: small, and large enough for a definite mass; its own modes lie
far above all others.
"""

ACROSS = 0.25
"""Poisson's ratios of contractions through a wall, which nobody states: 0.15 to 0.45 of metals,
fabrics and plies.
"""

MOST_ANGLES = 40
"""Plies up to which each ply's angle is a constant, `angle_1` from the bottom."""

_OF_MATERIAL = ("Ex", "Ey", "Gxy", "Gxz", "Gyz", "nu_xy")
_VOIGT = {"11": (0, 0), "12": (0, 1), "22": (1, 1), "66": (2, 2), "16": (0, 2), "26": (1, 2)}
_SHEARS = {"S55": (6, 6), "S44": (7, 7), "S45": (6, 7)}


@dataclass(frozen=True)
class ShellSection:
    """Plies from the bottom to the top along the elements' normal."""

    # the stack, with nominal constants; angles are from axis 1 towards axis 2 = normal × axis 1
    plies: tuple[Ply, ...]
    # axis 1 in the structure's frame, projected on the surface
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    offset: float = 0.0  # of the middle of the stack from the mesh along the normal, m
    # whether angles are constants: `angle` of the whole stack about the normal, and each ply's own,
    # rad
    turning: bool = False
    # whether its mass follows how it grows thinner; strips and plates leave that to the doubt of
    # the shear correction
    thins: bool = True

    def __post_init__(self) -> None:
        if not self.plies:
            raise InputError("section.plies", "is empty, expected at least one ply")
        if not np.linalg.norm(self.axis) > 0:
            raise InputError("section.axis", f"is {self.axis}, expected a direction")

    @property
    def thickness(self) -> float:
        """Nominal thickness, m."""
        return sum(ply.thickness for ply in self.plies)

    def default_parameters(self) -> tuple[Parameter, ...]:
        """What is updated of it: of an isotropic material its E, which the others follow."""
        return of_plies(self.nominal)

    @cached_property
    def materials(self) -> tuple[OrthotropicMaterial, ...]:
        """The plies' materials that differ in more than density, from the bottom."""
        return tuple(dict.fromkeys(replace(ply.material, density=1.0) for ply in self.plies))

    @cached_property
    def nominal(self) -> dict[str, float]:
        """Constants by name, SI: of the materials, `density` (mean), `t`, a `factor` of all
        stiffness, and angles.
        """
        nominal = {}
        for number, material in enumerate(self.materials, start=1):
            suffix = "" if number == 1 else f"_{number}"
            for name, stored in zip(PLY_CONSTANTS, _OF_MATERIAL, strict=True):
                nominal[name + suffix] = float(getattr(material, stored))
        mass = sum(ply.material.density * ply.thickness for ply in self.plies)
        nominal |= {"density": mass / self.thickness, "t": self.thickness, "factor": 1.0}
        if not self.turning:
            return nominal
        own = self.plies if len(self.plies) <= MOST_ANGLES else ()
        angles = {
            f"angle_{k}": float(np.radians(ply.angle_deg)) for k, ply in enumerate(own, start=1)
        }
        return {**nominal, "angle": 0.0, **angles}

    @property
    def is_plain(self) -> bool:
        """Whether axis 1 is an axis of symmetry and the middle surface one too: one ply, not
        turned, no offset.
        """
        return (
            len(self.plies) == 1
            and not self.plies[0].angle_deg
            and not self.offset
            and not self.turning
        )

    @cached_property
    def terms(self) -> tuple[str, ...]:
        """Names of the coefficients of the stiffness."""
        index = ("11", "12", "22", "66") if self.is_plain else tuple(_VOIGT)
        plane = tuple(letter + i for letter in ("AD" if self.is_plain else "ABD") for i in index)
        return (*plane, *(("S55", "S44") if self.is_plain else tuple(_SHEARS)))

    @cached_property
    def normal(self) -> AlongNormal | None:
        """Motion along the normal at nominal constants, which no change of constants moves; None
        where it does not count.
        """
        if not self.thins:
            return None
        q = {name: np.asarray(value) for name, value in self.nominal.items()}
        Q = np.array([self._ply(q, number)[0] for number in range(len(self.plies))])
        rows = []
        for ply in self.plies:
            first, second, angle = (
                ACROSS / ply.material.Ex,
                ACROSS / ply.material.Ey,
                np.radians(ply.angle_deg),
            )
            c, s = np.cos(angle), np.sin(angle)
            rows.append(
                [
                    first * c**2 + second * s**2,
                    first * s**2 + second * c**2,
                    2 * (first - second) * c * s,
                ]
            )
        density = np.array([ply.material.density for ply in self.plies])
        return along_normal(Q, np.array(rows), density, self._levels(q["t"]))

    @cached_property
    def matrices(self) -> FloatArray:
        """(k, 8, 8) C_k of the terms on the strains of a shell."""
        matrices = np.zeros((len(self.terms), 8, 8))
        for C, name in zip(matrices, self.terms, strict=True):
            for i, j in _places(name):
                C[i, j] = C[j, i] = 1
        return matrices

    @cached_property
    def blocks(self) -> tuple[IntArray, ...]:
        """Index matrices of the terms: those of forces and moments, and of shear."""
        at = {
            place: k
            for k, name in enumerate(self.terms)
            for pair in _places(name)
            for place in (pair, pair[::-1])
        }
        plane = ((0, 1), (2,), (3, 4), (5,)) if self.is_plain else (tuple(range(6)),)
        shears = ((6,), (7,)) if self.is_plain else ((6, 7),)
        return tuple(
            np.array([[at[i, j] for j in rows] for i in rows]) for rows in (*plane, *shears)
        )

    def coefficients(
        self, constants: Mapping[str, FloatArray], bending_only: bool = False
    ) -> FloatArray:
        """(k + 1, …) coefficients of the terms, and of the drilling, from constants (…) by name.

        Where a model bends alone, what little B has enters by the reduced stiffness D − B A⁻¹ B
        (Reddy, section 5.2).
        """
        A, B, D, S = self.stiffness(constants)
        if bending_only and np.any(B):
            D = D - B @ np.linalg.inv(A) @ B
        letters = {"A": A, "B": B, "D": D}
        rows = []
        for name in self.terms:
            if name[0] == "S":
                i, j = _SHEARS[name]
                rows.append(S[..., i - 6, j - 6])
            else:
                rows.append(letters[name[0]][(..., *_VOIGT[name[1:]])])
        return np.array([*rows, DRILLING * A[..., 2, 2]])

    def inertia(self, constants: Mapping[str, FloatArray]) -> FloatArray:
        """(4, …) I0, I1, I2 and that of the drilling, kg/m², kg/m, kg, kg."""
        t = constants["t"]
        levels = self._levels(t)
        parts = []
        for n in (1, 2, 3):
            height = (levels[1:] ** n - levels[:-1] ** n) / n
            summed = self._densities @ height.reshape(len(self.plies), -1)
            parts.append(summed.reshape(height.shape[1:]) * constants["density"])
        return np.array([*parts, DRILLING_INERTIA * parts[0] * t**2 / 12])

    @cached_property
    def _densities(self) -> FloatArray:
        """(1, n) of the plies, in the mean density."""
        density = np.array([[ply.material.density for ply in self.plies]])
        return density / (self.nominal["density"] or 1.0)

    def along(self, constants: Mapping[str, FloatArray], angle: float) -> FloatArray:
        """(6, …) of a wall as a beam along a line at an angle from axis 1 (rad).

        E and G in the plane, G across it, Pa; and EA, ES, EI per width, on the stretch and the
        curvature of the middle, of a wall that is free across the line.
        """
        A, B, D, S = self.stiffness(constants)
        t = constants["t"]
        c, s = np.cos(angle), np.sin(angle)
        strain = np.array(
            [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
        )
        A, B, D = (strain @ each @ strain.T for each in (A, B, D))
        across = c * c * S[..., 0, 0] + s * s * S[..., 1, 1] + 2 * c * s * S[..., 0, 1]
        E = 1 / (np.linalg.inv(A)[..., 0, 0] * t)
        free = np.linalg.inv(np.linalg.inv(np.block([[A, B], [B, D]]))[..., ::3, ::3])
        strip = free[..., 0, 0], free[..., 0, 1], free[..., 1, 1]
        return np.stack([E, A[..., 2, 2] / t, across / (SHEAR_CORRECTION * t), *strip])

    def _levels(self, t: FloatArray) -> FloatArray:
        """(n + 1, …) heights of the plies' faces."""
        return np.asarray(self._fractions.reshape(-1, *(1,) * np.ndim(t)) * t + self.offset)

    @cached_property
    def _fractions(self) -> FloatArray:
        """(n + 1,) heights of the plies' faces above the middle of the stack, in its thickness."""
        thicknesses = np.array([ply.thickness for ply in self.plies])
        shares: FloatArray = np.concatenate([[0.0], np.cumsum(thicknesses)]) / thicknesses.sum()
        return np.asarray(shares - 0.5)

    def stiffness(
        self, constants: Mapping[str, FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """(…, 3, 3) A, B, D and (…, 2, 2) S."""
        t = np.asarray(constants["t"])
        plies = [self._ply(constants, number) for number in range(len(self.plies))]
        factor = np.asarray(constants["factor"])[..., None, None]
        Q, C = np.array([factor * Q for Q, _ in plies]), np.array([factor * C for _, C in plies])
        levels = self._levels(t)
        low, high = levels[:-1, ..., None, None], levels[1:, ..., None, None]
        A, B, D = (np.sum(Q * (high**n - low**n) / n, axis=0) for n in (1, 2, 3))
        if len(plies) == 1:
            return A, B, D, SHEAR_CORRECTION * C[0] * t[..., None, None]
        middle = levels - self.offset
        low, high = middle[:-1, ..., None, None], middle[1:, ..., None, None]
        own = [np.sum(Q * (high**n - low**n) / n, axis=0) for n in (1, 2, 3)]
        whole = np.block([[own[0], own[1]], [own[1], own[2]]])
        return A, B, D, balanced_shear(Q, C, middle, np.linalg.inv(whole)[..., 3:])

    @cached_property
    def _suffixes(self) -> tuple[str, ...]:
        """Of each ply's material's constants."""
        numbers = [self.materials.index(replace(ply.material, density=1.0)) for ply in self.plies]
        return tuple("" if number == 0 else f"_{number + 1}" for number in numbers)

    def _ply(
        self, constants: Mapping[str, FloatArray], number: int
    ) -> tuple[FloatArray, FloatArray]:
        """(…, 3, 3) plane-stress and (…, 2, 2) transverse shear stiffness of a ply in the section's
        axes.
        """
        suffix = self._suffixes[number]
        E1, E2, G12, G13, G23, nu = (np.asarray(constants[name + suffix]) for name in PLY_CONSTANTS)
        own = np.radians(self.plies[number].angle_deg)
        angle = constants.get("angle", 0.0) + constants.get(f"angle_{number + 1}", own)
        rest = E1 - nu**2 * E2
        q11, q12, q22, q66, q16, q26 = turned_stiffness(
            E1**2 / rest, nu * E1 * E2 / rest, E1 * E2 / rest, G12, angle
        )
        c, s = np.cos(angle), np.sin(angle)
        s55, s44, s45 = G13 * c**2 + G23 * s**2, G23 * c**2 + G13 * s**2, (G13 - G23) * c * s
        return _matrix([[q11, q12, q16], [q12, q22, q26], [q16, q26, q66]]), _matrix(
            [[s55, s45], [s45, s44]]
        )


INERTIAS = (*(f"I{n}_{axis}" for n in (0, 1, 2) for axis in (1, 2, 3)), "drilling")
"""Coefficients of a shell's mass; motion along each axis has its own, so that a body's length and
width can be constants.
"""

OF_INERTIAS = (*np.repeat(range(3), 3), 3)
"""Which of `ShellSection.inertia` each is."""


def inertia_matrices() -> FloatArray:
    """(10, 7, 7) C_j of `INERTIAS` on the motions of a shell: u₀ (3), θ × d (3), θ · d."""
    matrices = np.zeros((10, 7, 7))
    for axis in range(3):
        u, b = axis, axis + 3
        matrices[axis, u, u] = matrices[axis + 3, u, b] = matrices[axis + 3, b, u] = matrices[
            axis + 6, b, b
        ] = 1
    matrices[9, 6, 6] = 1
    return matrices


def inertia_blocks() -> tuple[IntArray, ...]:
    """Index matrices of `INERTIAS`."""
    return (
        *(np.array([[axis, axis + 3], [axis + 3, axis + 6]]) for axis in range(3)),
        np.array([[9]]),
    )


def turned_stiffness(
    Q11: FloatArray, Q12: FloatArray, Q22: FloatArray, Q66: FloatArray, angle: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Q̄11, Q̄12, Q̄22, Q̄66, Q̄16 and Q̄26 of a material turned by an angle (Reddy, Eq. 2.4.8)."""
    c, s = np.cos(angle), np.sin(angle)
    even, sloped, steep = Q11 + Q22, Q11 - Q12 - 2 * Q66, Q12 - Q22 + 2 * Q66
    return (
        Q11 * c**4 + 2 * (Q12 + 2 * Q66) * s**2 * c**2 + Q22 * s**4,
        (even - 4 * Q66) * s**2 * c**2 + Q12 * (s**4 + c**4),
        Q11 * s**4 + 2 * (Q12 + 2 * Q66) * s**2 * c**2 + Q22 * c**4,
        (even - 2 * Q12 - 2 * Q66) * s**2 * c**2 + Q66 * (s**4 + c**4),
        sloped * s * c**3 + steep * s**3 * c,
        sloped * s**3 * c + steep * s * c**3,
    )


def _places(name: str) -> list[tuple[int, int]]:
    """Where a coefficient stands in the (8, 8) matrix of a section, by one half."""
    if name[0] == "S":
        return [_SHEARS[name]]
    i, j = _VOIGT[name[1:]]
    shift = {"A": (0, 0), "B": (0, 3), "D": (3, 3)}[name[0]]
    places = [(i + shift[0], j + shift[1])]
    if name[0] == "B" and i != j:
        places.append((j, i + 3))
    return places


def _matrix(rows: list[list[FloatArray]]) -> FloatArray:
    """(…, n, n) from rows of entries (…)."""
    entries = [entry for row in rows for entry in row]
    shape, n = np.broadcast_shapes(*map(np.shape, entries)), len(rows)
    matrix = np.empty((*shape, n, n), np.result_type(*entries))
    for place, entry in enumerate(entries):
        matrix[..., place // n, place % n] = entry
    return matrix


@dataclass(frozen=True)
class Section:
    """Stiffness and inertia of a laminate per unit of its area."""

    # A, B, D: (3, 3) membrane, coupling and bending stiffness, N/m, N, N·m
    A: FloatArray
    B: FloatArray
    D: FloatArray
    # (2, 2) transverse shear stiffness on (γxz, γyz) from equilibrium (`balanced_shear`), N/m
    S: FloatArray
    inertia: tuple[float, float, float]  # (I0, I1, I2) in kg/m², kg/m, kg
    thickness: float  # total thickness, m

    def bending_stiffness(self, width: float) -> float:
        """EI = b / d11 in N·m² of a strip along x, free to twist and to bend across; d = (D - B A⁻¹
        B)⁻¹, `width` b in m.
        """
        return float(width / np.linalg.inv(self.D - self.B @ np.linalg.inv(self.A) @ self.B)[0, 0])

    @property
    def is_coupled(self) -> bool:
        """Whether bending and membrane forces couple (B ≠ 0 beyond round-off, or I1 ≠ 0)."""
        scale = np.sqrt(np.abs(self.A).max() * np.abs(self.D).max())
        inertia_scale = self.inertia[0] * self.thickness
        return bool(
            np.abs(self.B).max() > 1e-10 * scale or abs(self.inertia[1]) > 1e-10 * inertia_scale
        )


def section(plies: Sequence[Ply]) -> Section:
    """Integrate a stack of plies, bottom to top, to its section stiffness and inertia at nominal
    constants.

    Raises:
        InputError: there is no ply.
    """
    stack = ShellSection(tuple(plies))
    q = {name: np.asarray(value) for name, value in stack.nominal.items()}
    I0, I1, I2, _ = stack.inertia(q).tolist()
    return Section(*stack.stiffness(q), (I0, I1, I2), stack.thickness)


def homogenise(laminate: Section) -> OrthotropicMaterial:
    """The single-layer material with the same bending stiffness, shear stiffness, mass and
    thickness as a laminate.

    With d = D⁻¹ and thickness t: Ex = 12/(t³ d11), Ey = 12/(t³ d22), Gxy = 12/(t³ d66), ν =
    -d12/d11, and Gxz = S55/(κt), Gyz = S44/(κt) (Jones, *Mechanics of Composite Materials*, for
    flexural engineering constants).

    Raises:
        InputError: bending couples with membrane forces or with twisting, which no orthotropic
            layer does.
    """
    D, t = laminate.D, laminate.thickness
    if laminate.is_coupled:
        raise InputError(
            "laminate",
            "couples bending and membrane forces (B ≠ 0): it has no equivalent single layer",
        )
    if (
        max(abs(D[0, 2]), abs(D[1, 2])) > ROUND_OFF * D[0, 0]
        or abs(laminate.S[0, 1]) > 1e-9 * laminate.S[0, 0]
    ):
        raise InputError(
            "laminate",
            "couples bending and twisting (D16, D26 ≠ 0): it has no equivalent orthotropic layer",
        )
    d = np.linalg.inv(D)
    bending, shear = 12 / t**3, SHEAR_CORRECTION * t
    return OrthotropicMaterial(
        Ex=float(bending / d[0, 0]),
        Ey=float(bending / d[1, 1]),
        Gxy=float(bending / d[2, 2]),
        Gxz=float(laminate.S[0, 0] / shear),
        Gyz=float(laminate.S[1, 1] / shear),
        nu_xy=float(-d[0, 1] / d[0, 0]),
        density=laminate.inertia[0] / t,
    )
