"""What a model foretells before anything is measured, and what would move its frequencies.

What would move the measured frequencies: parameters, stiffness, the support, a mass at a point.

A monitor explains its alarms by it; it also shows which modes each parameter moves.

A model before anything is measured: its modes, the points that show them, and the FRFs between
these.

With s_kp the motion at point p, along its direction, in mode k by the mode's largest displacement,
the accelerance at the resonance of mode k between points p and q is s_kp s_kq by that at its
liveliest place. So

- a reference, where one hits all the time or where the one sensor stays, is chosen by the mode that
  it shows least: the first has the largest min_k s_kp² of driving-point residues, each further one
  the largest min_k max_q s_kq² of all of them;
- points to measure are chosen by the determinant of the information about the modes' shares, Σ_p
  s_p s_pᵀ, one after the other (effective independence: Kammer, J. Guidance 14, 1991), and judged
  by the largest MAC between two modes at them.

Points are sought among nodes that lie far apart, so that no two of them say the same, each along
the axis in which the modes move it most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.body.constants import Body
from fecore.body.kinds import mode_kinds
from fecore.body.locate import evenly_spread
from fecore.body.mesh import Mesh
from fecore.body.model import Model, observed_at
from fecore.correlation import auto_mac
from fecore.dynamics.bodies import body_modes
from fecore.dynamics.eigen import FewModesError, NormalModes, modes_below
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.errors import InputError
from fecore.quantities import CLAMP, is_of_stiffness
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.forward import ForwardState
from fecore.updating.mesh import meshed, nominal_matrices, on_finer_mesh
from fecore.updating.result import Prediction
from fecore.updating.state import PointPairs
from fecore.updating.suspects import sites


@dataclass(frozen=True)
class FrequencyEffects:
    """Derivatives of the logarithms of n measured frequencies at the updated model; NaN where a
    mode has no partner.
    """

    # (n,) by name of a constant that was updated, the change of ln f by one prior standard
    # deviation of it
    parameter: dict[str, FloatArray]
    stiffness: dict[str, FloatArray]  # (n,) by name of a stiffness θ, ∂ln f/∂ln θ
    # (n,) by name of an input of the support, the change of ln f by one prior standard deviation of
    # it
    support: dict[str, FloatArray]
    sites: FloatArray  # (P, 3) nodes at which a mass is tried, m
    # (n, P) change of ln f by a mass at each of them, -φ²/2 with the mass-normalised displacement
    # φ, 1/kg
    mass: FloatArray
    # median ratio of the measured FRFs' magnitudes to the model's; None without FRFs
    frf_scale: float | None


def frequency_effects(elastic: ElasticResult, prediction: Prediction | None) -> FrequencyEffects:
    """The effects at the estimate of one campaign."""
    prior, forward, slopes = elastic.prior, elastic.updated.forward, elastic.problem.sensitivity
    rows, columns = (np.array(each, dtype=int) for each in zip(*elastic.pairing.pairs, strict=True))

    def of_measured(values: FloatArray) -> FloatArray:
        whole = np.full((len(elastic.only.modes), *values.shape[1:]), np.nan)
        whole[rows] = values
        return whole

    free = dict(enumerate(prior.names))
    at_support = {spring.name for spring in forward.specimen.springs} | {CLAMP}
    held = bool(elastic.updated.modes.rigid == 0)
    support = {
        each.name: each.shift[columns]
        for each in elastic.all_systematic_effects
        if each.name.startswith("clamp")
    }
    by_one_sd = {
        name: slopes[:, place] * elastic.layout.unknowns[place].sd for place, name in free.items()
    }
    support |= {
        name: by_one_sd[name]
        for name in by_one_sd
        if name in at_support or (held and name == "length")
    }
    stiffness = {
        name: slopes[:, place]
        for place, name in free.items()
        if name in prior.reported
        and name not in at_support
        and prior.logarithmic[place]
        and is_of_stiffness(name)
    }
    sites, moved = motion_at_sites(elastic.updated)
    return FrequencyEffects(
        parameter={
            name: of_measured(each) for name, each in by_one_sd.items() if name in prior.reported
        },
        stiffness={name: of_measured(each) for name, each in stiffness.items()},
        support={name: of_measured(each) for name, each in support.items()},
        sites=sites,
        mass=of_measured(-np.sum(moved[elastic.updated.modes.rigid + columns] ** 2, axis=2) / 2),
        frf_scale=None if prediction is None else _scale(prediction),
    )


def motion_at_sites(state: ForwardState) -> tuple[FloatArray, FloatArray]:
    """(P, 3) some nodes, evenly spread, and (m, P, 3) their mass-normalised displacements in all
    modes, held ones 0.
    """
    model, chosen = state.forward.specimen.model, sites(state)
    return model.mesh.nodes[chosen], model.at_nodes(state.every_shape)[:, chosen]


def _scale(prediction: Prediction) -> float | None:
    """Median of |H measured / H updated| over the fitted FRFs."""
    fitted = list(prediction.fitted)
    measured, updated = np.abs(prediction.measured[fitted]), np.abs(prediction.updated[fitted])
    seen = (measured > 0) & (updated > 0)
    return float(np.exp(np.median(np.log(measured[seen] / updated[seen])))) if seen.any() else None


CANDIDATES = 200
"""Nodes among which points are sought."""

MOST_MODES, MOST_LINES = 300, 20_000

_USUAL_MODES = 10  # where neither a number nor a band is stated
# times the highest frequency: modes up to there are summed, those beyond are in the residual's
# series
_COVERED = 1.5
# share of what turns would move at the body's size, below which a displacement is round-off
_STILL = 1e-6
# of a lively point's information, known beforehand so that the determinant is never 0
_LITTLE = 1e-3


@dataclass(frozen=True)
class ForecastOrder:
    """What is asked of a model."""

    # how many of the lowest, where no band is stated; None: 10, or all where there are fewer
    modes: int | None = None
    highest_hz: float | None = None  # of the band; None: by the number of modes
    # (p, 3) points among which to choose, m; None: nodes of the mesh
    places: FloatArray | None = None
    labels: Sequence[int] | None = None  # of these, for errors
    # (p,) axis 1, 2 or 3 along which each of these moves or is hit; 0: that in which the modes move
    # it most
    axes: IntArray | None = None
    points: int = 12  # how many to measure at
    references: int = 1  # how many of them
    damping_ratio: float | None = None  # of all modes; None: no FRFs
    spacing_hz: float | None = None  # of the lines; None: four in the first mode's half-power width


@dataclass(frozen=True)
class ModelForecast:
    """What a model says."""

    mesh: Mesh  # the mesh that was solved
    rigid: int  # number of rigid-body modes, which are not among the others
    frequency_hz: FloatArray  # (n,) of the elastic modes, on that mesh
    # (n,) the same modes' on a finer one; None where the mesh is taken on trust
    finer_hz: FloatArray | None
    kinds: tuple[str, ...]  # of them, in words
    everywhere: FloatArray  # (n, nodes, 3) mass-normalised shapes on the mesh
    numbers: IntArray  # (p,) of the chosen points, of the places or else of the nodes, from 0
    places: FloatArray  # (p, 3) m
    axes: IntArray  # (p,) 1, 2 or 3
    shapes: FloatArray  # (n, p) mass-normalised shapes at the points
    seen: FloatArray  # (n, p) share of each mode's largest displacement there
    references: tuple[int, ...]  # numbers of references among the points
    measured: tuple[int, ...]  # numbers of points to measure at among the points
    mac: FloatArray  # (n, n) between the modes at these
    lines_hz: FloatArray  # (L,) of the FRFs
    # (references × measured, L) accelerances, the measured points of one reference after another;
    # m/s² per N
    frfs: ComplexArray


def forecast(body: Body, order: ForecastOrder) -> ModelForecast:
    """Solve the nominal model of a body.

    Raises:
        InputError: no mode lies in the band, the model has fewer modes, or a point lies off the
            body.
        ModelError: the eigenproblem cannot be solved.
    """
    if min(body.model.dofs) > 2:
        raise InputError("points", "show nothing: this model has turns alone, and no displacements")
    fine, nominal, modes, count = _solved(body, order)
    highest = order.highest_hz or float(modes.frequency_hz[modes.rigid + count - 1])
    elastic = slice(modes.rigid, modes.rigid + count)
    finer = nominal.on_finer_mesh(modes)
    shapes, frequency = modes.shapes[:, elastic], modes.frequency_hz[elastic]
    everywhere, largest = _displacements(fine.model, shapes)
    rows = _Rows.of(
        fine, shapes * np.where(largest > 0, 1 / np.where(largest > 0, largest, 1), 0), order
    )
    references = rows.shown_least(order.references)
    measured = rows.independent(order.points)
    kept = np.unique([*references, *measured])
    among = [tuple(np.searchsorted(kept, chosen).tolist()) for chosen in (references, measured)]
    lines = _lines(order, frequency[0], highest)
    return ModelForecast(
        mesh=fine.model.mesh,
        rigid=modes.rigid,
        frequency_hz=frequency,
        finer_hz=None if finer is None else finer[:count],
        kinds=mode_kinds(fine.model, shapes),
        everywhere=everywhere,
        numbers=rows.numbers[kept],
        places=rows.places[kept],
        axes=rows.axes[kept],
        shapes=rows.amplitudes[:, kept] * largest[:, None],
        seen=np.abs(rows.amplitudes[:, kept]),
        references=among[0],
        measured=among[1],
        mac=np.nan_to_num(auto_mac(rows.amplitudes[:, measured])),
        lines_hz=lines,
        frfs=nominal.frfs(modes, rows.observation[kept], among, lines, order.damping_ratio or 0.0),
    )


def _displacements(model: Model, shapes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, nodes, 3) displacements in (dofs, n) shapes, and (n,) the largest of each; 0 in place of
    round-off.

    A straight stick twists about its own nodes, which turn and do not move.
    """
    motion = model.everywhere(shapes)
    moved = np.ascontiguousarray(motion[:, :3].transpose(2, 0, 1))
    largest = np.linalg.norm(moved, axis=2).max(axis=1)
    turned = np.abs(motion[:, 3:]).max(axis=(0, 1)) * np.linalg.norm(
        np.ptp(model.mesh.nodes, axis=0)
    )
    motionless = largest <= _STILL * turned
    moved[motionless], largest[motionless] = 0.0, 0.0
    return moved, largest


def _solved(body: Body, order: ForecastOrder) -> tuple[Body, _Nominal, NormalModes, int]:
    """The body on a mesh for the band, its matrices and modes, and how many elastic ones are asked
    for.
    """
    if order.highest_hz is not None:
        fine, _ = meshed(body, order.highest_hz)
        nominal = _Nominal(fine)
        return fine, nominal, *nominal.up_to(order.highest_hz)
    nominal = _Nominal(body)
    modes, count = nominal.lowest(order.modes)
    fine, _ = meshed(body, float(modes.frequency_hz[modes.rigid + count - 1]))
    if fine is not body:
        nominal = _Nominal(fine)
        modes, count = nominal.lowest(order.modes)
    return fine, nominal, modes, count


class _Nominal:
    """A body's matrices at nominal constants."""

    def __init__(self, body: Body) -> None:
        self.body, (self.stiffness, self.mass) = body, nominal_matrices(body)

    def lowest(self, requested: int | None) -> tuple[NormalModes, int]:
        """So many elastic modes, half as many more that FRFs are summed of where there are any, and
        how many are wanted.
        """
        count = requested or _USUAL_MODES
        computed = count + count // 2 + 1
        while True:
            try:
                return self._modes(computed), min(count, computed)
            except FewModesError as error:
                computed = error.available
                if computed < (requested or 1):
                    raise InputError(
                        "modes", f"is {count}, and the model has {computed} besides rigid motions"
                    ) from None

    def up_to(self, highest_hz: float) -> tuple[NormalModes, int]:
        """The modes that FRFs up to a frequency are summed of, and how many elastic ones are in the
        band.
        """
        rigid = self.body.model.rigid_modes.shape[1]
        in_band, covered = (
            modes_below(self.stiffness, self.mass, (2 * np.pi * hz) ** 2) - rigid
            for hz in (highest_hz, _COVERED * highest_hz)
        )
        if not 1 <= in_band <= MOST_MODES:
            first = self._modes(1).frequency_hz[rigid]
            content = f"holds {in_band} modes; the first is at {first:.4g} Hz"
            raise InputError(
                "highest_hz",
                f"is {highest_hz:g} Hz and {content}, expected 1 to {MOST_MODES} modes",
            )
        return self._modes(min(covered, self.stiffness.shape[0] - rigid)), in_band

    def on_finer_mesh(self, modes: NormalModes) -> FloatArray | None:
        """(n,) frequencies of the elastic modes on a finer mesh, Hz; None where there is none."""
        constants = np.array(list(self.body.nominal.values()))
        springs = [each.stiffness for each in self.body.springs]
        return on_finer_mesh(self.body, modes, constants, np.array(springs))

    def _modes(self, elastic: int) -> NormalModes:
        return body_modes(self.body.model, self.stiffness, self.mass, elastic)

    def frfs(
        self,
        modes: NormalModes,
        observation: scipy.sparse.csr_array,
        among: Sequence[tuple[int, ...]],
        lines_hz: FloatArray,
        damping_ratio: float,
    ) -> ComplexArray:
        """(references × measured, L) accelerances."""
        references, measured = among
        pairs = PointPairs(
            np.tile(measured, len(references)),
            np.repeat(references, len(measured)),
            np.ones(len(references) * len(measured)),
        )
        if not lines_hz.size:
            return np.zeros((len(pairs.sign), 0), dtype=complex)
        shapes = (observation @ modes.shapes).T
        residual = pairs.residual(modes, self.mass, observation)
        model = ModalFrfModel(modes.eigenvalue, pairs.products(shapes), residual, modes.shift)
        return model.synthesise(lines_hz, 2 * damping_ratio * modes.omega)


@dataclass(frozen=True)
class _Rows:
    """Points among which to choose."""

    numbers: IntArray  # (p,) of the nodes, or of the places that were named
    places: FloatArray  # (p, 3) m
    axes: IntArray  # (p,) 1, 2 or 3
    observation: scipy.sparse.csr_array  # (p, dofs) displacement along these
    amplitudes: FloatArray  # (n, p) of each mode, by its largest displacement

    @classmethod
    def of(cls, body: Body, shapes: FloatArray, order: ForecastOrder) -> _Rows:
        """The points of an order on a body whose (dofs, n) shapes have the largest displacement
        1.
        """
        model = body.model
        free = [axis for axis in range(3) if axis in model.dofs]
        numbers = _apart(model.mesh) if order.places is None else np.arange(len(order.places))
        labels = numbers.tolist() if order.labels is None else order.labels
        if order.places is None:
            places = model.mesh.nodes[numbers]
            along = [model.observe_nodes(numbers, axis) for axis in free]
        else:
            places = order.places
            along = [
                observed_at(model, labels, places, np.tile(np.eye(3)[axis], (len(places), 1)))
                for axis in free
            ]
        choice = np.argmax([np.sum((rows @ shapes) ** 2, axis=1) for rows in along], axis=0)
        for point, axis in enumerate(() if order.axes is None else order.axes.tolist()):
            if axis and axis - 1 not in free:
                raise InputError(
                    "points",
                    f"{labels[point]} has direction {axis}, along which this model does not move",
                )
            choice[point] = free.index(axis - 1) if axis else choice[point]
        observation = scipy.sparse.vstack(along, format="csr")[
            choice * len(places) + np.arange(len(places))
        ]
        return cls(
            numbers, places, np.array(free)[choice] + 1, observation, (observation @ shapes).T
        )

    def shown_least(self, count: int) -> IntArray:
        """Points with the largest share of the mode that they show least, one after the other."""
        seen, chosen = np.abs(self.amplitudes), np.zeros(0, dtype=np.int64)
        shown = np.zeros(len(seen))
        for _ in range(min(count, seen.shape[1])):
            least = np.maximum(seen, shown[:, None]).min(axis=0) + _LITTLE * seen.mean(axis=0)
            least[chosen] = -1.0
            chosen = np.append(chosen, np.argmax(least))
            shown = np.maximum(shown, seen[:, chosen[-1]])
        return chosen

    def independent(self, count: int) -> IntArray:
        """Points with the largest determinant of information, one after the other: det(A + ssᵀ) =
        det A (1 + sᵀA⁻¹s).
        """
        s, chosen = self.amplitudes, np.zeros(0, dtype=np.int64)
        information = _LITTLE * np.eye(len(s))
        for _ in range(min(count, s.shape[1])):
            gain = np.sum(s * np.linalg.solve(information, s), axis=0)
            gain[chosen] = -1.0
            chosen = np.append(chosen, np.argmax(gain))
            information += np.outer(s[:, chosen[-1]], s[:, chosen[-1]])
        return chosen


def _apart(mesh: Mesh) -> IntArray:
    """Numbers of some nodes of elements that lie far apart."""
    used = np.unique(np.concatenate([block.nodes.ravel() for block in mesh.blocks]))
    return np.asarray(used[evenly_spread(mesh.nodes[used], CANDIDATES)])


def _lines(order: ForecastOrder, first_hz: float, highest_hz: float) -> FloatArray:
    """Lines of the FRFs from one spacing up to the highest frequency."""
    if order.damping_ratio is None:
        return np.zeros(0)
    fine = highest_hz / MOST_LINES
    spacing = order.spacing_hz or max(order.damping_ratio * first_hz / 2, fine)
    if spacing < fine * (1 - 1e-9):
        raise InputError(
            "line_spacing_hz",
            f"of {spacing:g} makes more than {MOST_LINES} lines up to {highest_hz:g} Hz",
        )
    if spacing > highest_hz:
        raise InputError(
            "line_spacing_hz", f"of {spacing:g} leaves no line up to {highest_hz:g} Hz"
        )
    return spacing * np.arange(1, int(highest_hz / spacing) + 1)
