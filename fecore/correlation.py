"""How well two sets of shapes or FRFs agree, and which mode of one set is which of the other.

Criteria are those of `docs/theory.md`, section 7, with Hermitian products for complex data (the
paper prints plain transposes). Shapes come as rows, (modes, dofs); FRFs as (FRFs, lines). A
criterion of vectors without any magnitude is 0/0 and returned as NaN, for that
entry alone: a dead channel must not hide the others.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.errors import InputError
from fecore.findings import Finding, make, remark, texts

# a model's frequency is expected within some 20 % (as ln ratio) of the measured one
_FREQUENCY_SCALE = 0.2
# what lying that far off costs a pair: as much as a MAC of 0.98 in place of 1.00
_FREQUENCY_WEIGHT = 0.25
_UNLIKENESS = 0.05  # 1 - MAC that noise and model error make of a true pair
_OWN = 0.01  # of a mode's own MAC, which settles whose partner it is of modes that may mix
# share of any shape in a span of modes, above which the dofs are too few for the span to say
# something
_CHANCE = 0.1
FEWEST_PAIRS = 2  # of modes, for criteria of dofs over them: of one pair these are 1
MOST_PAIRED_LINES = 100  # of which every pair is compared; of more lines every second, third, …


def mac(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Modal assurance criterion, MAC_jk = |a_jᴴb_k|² / (a_jᴴa_j · b_kᴴb_k) (Allemang and Brown
    1982; Eq. 15 with φ_nuᴴφ_nu).

    Args:
        a: (n, p) shapes, or (p,) one shape.
        b: (m, p) shapes at the same dofs.

    Returns:
        (n, m) values from 0 to 1; NaN where a shape is zero.

    Raises:
        InputError: the shapes have different dofs, or are not finite.
    """
    left, right = _rows("a", a), _rows("b", b)
    if left.shape[1] != right.shape[1]:
        raise InputError(
            "shapes", f"have {left.shape[1]} and {right.shape[1]} dofs, expected the same dofs"
        )
    return _each_with_each(left, right)


def auto_mac(shapes: ArrayLike) -> FloatArray:
    """MAC of a set of shapes with itself, (n, n): large off-diagonal values are modes that the dofs
    do not distinguish.
    """
    return mac(shapes, shapes)


def frac(measured: ArrayLike, predicted: ArrayLike) -> FloatArray:
    """Frequency response assurance criterion of each FRF over its lines, (N,): |H_eᴴH_n|² /
    (H_eᴴH_e · H_nᴴH_n).

    Args:
        measured: (N, L) FRFs.
        predicted: (N, L) FRFs on the same lines.

    Raises:
        InputError: the two arrays have different shapes, or are not finite.
    """
    return _assurance(*_pair("frfs", measured, predicted), axis=1)


def sac(measured: ArrayLike, predicted: ArrayLike) -> FloatArray:
    """Signature assurance criterion of each FRF, (N,): FRAC of magnitudes (Eq. 16). Arguments as
    `frac`.
    """
    left, right = _pair("frfs", measured, predicted)
    return _assurance(np.abs(left).astype(complex), np.abs(right).astype(complex), axis=1)


def csac(measured: ArrayLike, predicted: ArrayLike) -> FloatArray:
    """Cross signature assurance criterion of each line over all FRFs, (L,) (Eq. 17). Arguments as
    `frac`.
    """
    return _assurance(*_pair("frfs", measured, predicted), axis=0)


def csf(measured: ArrayLike, predicted: ArrayLike) -> FloatArray:
    """Cross signature scale factor of each line, (L,): 2|H_eᴴH_n| / (H_eᴴH_e + H_nᴴH_n) (Eq. 18);
    as `frac`.
    """
    left, right = _pair("frfs", measured, predicted)
    cross = np.abs(np.sum(left.conj() * right, axis=0))
    return _ratio(2 * cross, np.sum(np.abs(left) ** 2 + np.abs(right) ** 2, axis=0))


def fdac(measured: ArrayLike, predicted: ArrayLike) -> FloatArray:
    """Frequency domain assurance criterion, (L, M): MAC of the measured FRFs at each line with the
    predicted ones at each of theirs (Pascual, Golinval and Razeto 1997).

    Large values beside the diagonal show by how much the model's frequencies are off; on it, where
    the lines are the same, it is CSAC.

    Args:
        measured: (N, L) FRFs.
        predicted: (N, M) the same FRFs, on any lines.

    Raises:
        InputError: there are different numbers of FRFs, or they are not finite.
    """
    left, right = _rows("frfs", measured), _rows("frfs", predicted)
    if len(left) != len(right):
        raise InputError("frfs", f"are {len(left)} and {len(right)}, expected the same FRFs")
    return _each_with_each(left.T, right.T)


def comac(measured: ArrayLike, predicted: ArrayLike) -> FloatArray:
    """Coordinate MAC of each dof over pairs of modes, (p,): (Σ_r |φ_e φ_n|)² / (Σ_r |φ_e|² ·
    Σ_r |φ_n|²) (Lieven and Ewins 1988).

    Shapes are scaled to unit length first, so that none outweighs the others. Magnitudes alone
    count: a dof of the wrong sign does not show. Of one pair it is 1.

    Args:
        measured: (n, p) shapes.
        predicted: (n, p) shapes of their partners at the same dofs.

    Raises:
        InputError: the two arrays have different shapes, or are not finite.
    """
    left, right = (np.abs(_unit(each)) for each in _pair("shapes", measured, predicted))
    return _assurance(left.astype(complex), right.astype(complex), axis=0)


Of = Literal["FRFs", "shapes"]
Axis = Literal["FRF", "line", "pair of lines", "dof"]


@dataclass(frozen=True)
class Criterion:
    """How well what was measured and what the model predicts agree: values from 0 to 1."""

    name: str  # of its function, in documents, and of its array
    label: str  # as people write it
    meaning: str  # what it stands for, in words
    says: str  # what a figure of it shows, in words
    of: Of  # what it compares: (N, L) FRFs, or (n, p) shapes of paired modes
    axis: Axis  # what it has a value of
    figure: str  # name of the figure that shows it
    function: Callable[[ArrayLike, ArrayLike], FloatArray]  # of measured and predicted ones

    @property
    def is_mean(self) -> bool:
        """Whether a result states its mean, as there are too many values to be read."""
        return self.axis in ("line", "pair of lines")

    @property
    def member(self) -> str:
        """Name of the member of a result that states it."""
        return f"{self.name}_mean" if self.is_mean else self.name

    @property
    def sentence(self) -> str:
        """What that member is, in words."""
        return f"{self.meaning}, {_STATED[self.axis]}"

    def stated(self, values: FloatArray | None) -> Any:
        """What a result states of its values: themselves or their mean; nothing without any."""
        if not self.is_mean:
            return [] if values is None else values
        if values is None:
            return None
        return float(np.nanmean(values if values.ndim == 1 else np.fmax.reduce(values, axis=1)))


_STATED: dict[Axis, str] = {
    "FRF": "of each FRF",
    "line": "mean over the lines",
    "pair of lines": "of each measured line with the predicted one that is most like it, mean",
    "dof": "of each measured dof over the paired modes; empty of fewer than two pairs",
}

_TABLE = (
    Criterion(
        *("sac", "SAC", "signature assurance criterion", "agreement in magnitude"),
        *("FRFs", "FRF", "sac", sac),
    ),
    Criterion(
        *("frac", "FRAC", "frequency response assurance criterion", "agreement in value"),
        *("FRFs", "FRF", "sac", frac),
    ),
    Criterion(
        *("csac", "CSAC", "cross signature assurance criterion", "agreement in shape"),
        *("FRFs", "line", "csac", csac),
    ),
    Criterion(
        *("csf", "CSF", "cross signature scale factor", "agreement in level"),
        *("FRFs", "line", "csf", csf),
    ),
    Criterion(
        *("fdac", "FDAC", "frequency domain assurance criterion", "agreement in shape"),
        *("FRFs", "pair of lines", "fdac", fdac),
    ),
    Criterion(
        *("comac", "COMAC", "coordinate modal assurance criterion", "agreement of shapes"),
        *("shapes", "dof", "comac", comac),
    ),
)
CRITERIA = {criterion.name: criterion for criterion in _TABLE}
"""Every criterion, by its name, in the order in which tables show them."""


class Agreement(dict[str, FloatArray]):
    """Values of criteria by their names, as items and as attributes: (N,) of those of FRFs, (L,) of
    lines, (l, l) of pairs of lines, (p,) of dofs.
    """

    def __getattr__(self, name: str) -> FloatArray:
        if name in self:
            return self[name]
        raise AttributeError(name)


def correlate(of: Of, measured: ComplexArray, predicted: ComplexArray) -> Agreement:
    """All criteria of FRFs, (N, L), or of the shapes of paired modes, (n, p); pairs of lines of at
    most `MOST_PAIRED_LINES` lines.
    """
    few = paired_lines(measured.shape[1])
    criteria = [each for each in _TABLE if each.of == of]
    return Agreement(
        (
            each.name,
            each.function(measured[:, few], predicted[:, few])
            if each.axis == "pair of lines"
            else each.function(measured, predicted),
        )
        for each in criteria
    )


def paired_lines(count: int) -> slice:
    """Which of so many lines are compared in pairs."""
    return slice(0, count, max(1, -(-count // MOST_PAIRED_LINES)))


def frequency_error(measured_hz: ArrayLike, predicted_hz: ArrayLike) -> FloatArray:
    """(predicted - measured)/measured of paired natural frequencies, a ratio.

    Raises:
        InputError: lengths differ, or a measured frequency is not positive.
    """
    left, right = np.asarray(measured_hz, dtype=float), np.asarray(predicted_hz, dtype=float)
    if left.shape != right.shape:
        raise InputError("predicted_hz", f"has shape {right.shape}, expected {left.shape}")
    if np.any(left <= 0):
        raise InputError("measured_hz", "must be positive")
    return np.asarray((right - left) / left)


REMARKS = {
    "without_partner": remark(
        "measured {own} has no partner in the model", subject="measured {own}"
    ),
    "not_measured": remark("model {model} was not measured", subject="model {model}"),
    "fits_two": remark(
        "measured {own} is paired with model {model}, but model {other} fits nearly as well",
        subject="measured {own}",
    ),
}
"""What a pairing says of modes, by its id."""


@dataclass(frozen=True)
class Pairing:
    """Which measured mode is which model mode."""

    # (measured index, model index), ascending in the measured one
    pairs: tuple[tuple[int, int], ...]
    # (n_measured, n_model) MAC matrix, or None where pairing went by frequency. That of a pair is
    # the measured shape's with the span of all modes that may mix with its partner (`span_mac`).
    mac: FloatArray | None
    unpaired_measured: tuple[int, ...]  # measured modes without a partner
    # model modes within the measured range of frequency without a partner
    unpaired_model: tuple[int, ...]
    # (measured, model, other model) where the other fits nearly as well, within the margin
    ambiguous: tuple[tuple[int, int, int], ...]

    def notes(self, measured_hz: ArrayLike, model_hz: ArrayLike) -> tuple[Finding, ...]:
        """What a user must know of modes that are unpaired or ambiguous."""
        own, model = (
            [f"mode {i} ({hz:.2f} Hz)" for i, hz in enumerate(np.atleast_1d(each).tolist(), 1)]
            for each in (measured_hz, model_hz)
        )
        return (
            *(make(REMARKS, "without_partner", own=own[i]) for i in self.unpaired_measured),
            *(make(REMARKS, "not_measured", model=model[j]) for j in self.unpaired_model),
            *(
                make(REMARKS, "fits_two", own=own[i], model=model[j], other=model[k])
                for i, j, k in self.ambiguous
            ),
        )

    def messages(self, measured_hz: ArrayLike, model_hz: ArrayLike) -> tuple[str, ...]:
        """The notes, in words."""
        return texts(self.notes(measured_hz, model_hz))


def pair_modes(
    measured_shapes: ArrayLike | None,
    model_shapes: ArrayLike | None,
    measured_hz: ArrayLike,
    model_hz: ArrayLike,
    minimum_mac: float = 0.5,
    margin: float = 0.1,
    maximum_frequency_ratio: float = 3.0,
    *,
    hidden: Sequence[int] = (),
    mixing: float = 0.0,
    highest_hz: float = np.inf,
) -> Pairing:
    """Pair measured with model modes as one assignment problem, never one by one.

    1. Each measured mode is compared with each of the model: by MAC, or by its share in the span of
       modes that may mix.
    2. Pairs below `minimum_mac`, further apart than `maximum_frequency_ratio`, or with a hidden
       mode are not allowed.
    3. The score of a pair is its MAC's less a small penalty for the distance in frequency, (ln
       f_n/f_e)², which settles which of two model modes is meant when sparse points make them look
       alike (spatial aliasing). Without shapes the order and distance in frequency decide.
    4. The pairs are those with the largest sum of scores.
    5. Modes that are left, and pairs that another mode fits nearly as well, are said.

    Args:
        measured_shapes: (n, p) shapes, or None.
        model_shapes: (m, p) shapes at the same dofs, or None.
        measured_hz: (n,) measured frequencies.
        model_hz: (m,) model frequencies.
        minimum_mac: least MAC of a pair.
        margin: a pair is ambiguous when another model mode within a factor 1.5 in frequency of the
            measured one comes within this much MAC (without shapes: when another is nearly as near
            in frequency).
        maximum_frequency_ratio: furthest ratio of frequencies of a pair.
        hidden: numbers of model modes that no sensor of this test can see: in-plane ones.
        mixing: relative distance of model modes within which the model's error may mix their
            shapes: a measured one is then compared with their span.
        highest_hz: up to where modes were looked for: those of the model beyond are not missed.

    Raises:
        InputError: shapes and frequencies that do not fit together.
    """
    measured, model = np.asarray(measured_hz, dtype=float), np.asarray(model_hz, dtype=float)
    if measured.ndim != 1 or model.ndim != 1 or not measured.size or not model.size:
        raise InputError(
            "measured_hz",
            f"and model_hz have shapes {measured.shape} and {model.shape}, expected two lists",
        )
    if np.any(measured <= 0) or not np.all(np.isfinite(measured)) or not np.all(np.isfinite(model)):
        raise InputError("measured_hz", "must be positive and finite, model_hz finite")
    # 1. Likeness.
    distance = np.abs(np.log(np.maximum(model, 1e-9)[None, :] / measured[:, None]))
    matrix, likeness = None, distance
    if measured_shapes is not None and model_shapes is not None:
        matrix = mac(measured_shapes, model_shapes)
        if matrix.shape != distance.shape:
            raise InputError(
                "measured_shapes",
                f"and model_shapes give {matrix.shape} pairs, frequencies {distance.shape}",
            )
        likeness = span_mac(matrix, measured_shapes, model_shapes, model, mixing, hidden)
    # 2. Allowed pairs.
    allowed = distance <= np.log(maximum_frequency_ratio)
    allowed[:, list(hidden)] = False
    if matrix is not None:
        allowed &= likeness >= minimum_mac
    # 3. Scores.
    if matrix is None:
        score = np.exp(-distance / _FREQUENCY_SCALE)
    else:
        own = np.nan_to_num(matrix)
        far = np.minimum((distance / _FREQUENCY_SCALE) ** 2, 4.0)
        score = -np.log(1 + _UNLIKENESS - likeness) - _FREQUENCY_WEIGHT * far
        score[likeness > own] += _OWN * own[likeness > own]
    # 4. Pairs.
    pairs = _assign(score, allowed)
    if matrix is not None:
        for pair in pairs:
            matrix[pair] = likeness[pair]
    # 5. What is left, or ambiguous.
    ambiguous = _ambiguous(
        pairs, score if matrix is None else np.nan_to_num(matrix), distance, margin
    )
    taken = {j for _, j in pairs} | set(hidden)
    low, high = (
        measured.min() * (1 - _FREQUENCY_SCALE),
        min(measured.max() * (1 + _FREQUENCY_SCALE), highest_hz),
    )
    return Pairing(
        pairs,
        matrix,
        tuple(i for i in range(measured.size) if i not in {i for i, _ in pairs}),
        tuple(j for j in range(model.size) if j not in taken and low <= model[j] <= high),
        ambiguous,
    )


def span_mac(
    matrix: FloatArray,
    measured_shapes: ArrayLike,
    model_shapes: ArrayLike,
    model_hz: FloatArray,
    mixing: float,
    hidden: Sequence[int] = (),
) -> FloatArray:
    """(n, m) share of each measured shape in the span of each model mode and those that may mix
    with it; else the MAC.

    Two modes of nearly one frequency have any shapes of their span where the structure is not quite
    the model.

    Args:
        matrix: (n, m) MAC; NaN counts as 0.
        measured_shapes: (n, p).
        model_shapes: (m, p).
        model_hz: (m,).
        mixing: relative distance of frequencies within which modes may mix.
        hidden: numbers of model modes that take no part.
    """
    likeness = np.nan_to_num(matrix)
    if not mixing:
        return likeness
    measured, model = _rows("measured_shapes", measured_shapes), _rows("model_shapes", model_shapes)
    size = np.linalg.norm(measured, axis=1)
    close = (
        np.abs(np.log(np.maximum(model_hz, 1e-9) / np.maximum(model_hz, 1e-9)[:, None])) < mixing
    )
    close[:, list(hidden)] = False
    for j in np.flatnonzero(close.sum(axis=1) > 1).tolist():
        group = np.flatnonzero(close[j])
        if close[j, j] and group.size <= _CHANCE * model.shape[1]:
            span = np.linalg.qr(_unit(model[group]).T)[0]
            share = np.linalg.norm(measured @ span.conj(), axis=1) / np.where(size, size, 1)
            likeness[:, j] = np.maximum(likeness[:, j], np.minimum(share**2, 1.0))
    return likeness


def most_alike(coefficients: FloatArray) -> IntArray:
    """Which of m modes each of n others is most like, all together, by what it has of them.

    Args:
        coefficients: (n, m) amplitudes of the n modes in the m, or cosines between their shapes; m
            is at least n.

    Returns:
        (n,) numbers among the m, each once at most.
    """
    return np.asarray(scipy.optimize.linear_sum_assignment(-(coefficients**2))[1])


def _assign(score: FloatArray, allowed: np.ndarray) -> tuple[tuple[int, int], ...]:
    """Pairs of the largest total score; a mode may stay alone, which scores nothing but beats a
    forbidden pair.
    """
    n, m = score.shape
    # an allowed pair is better than leaving both alone, the likest most
    little = 1e-6 * np.exp(np.minimum(score, 0.0))
    benefit = np.where(allowed, np.maximum(score, little), -1.0)
    padded = np.zeros((n, m + n))
    padded[:, :m] = benefit
    rows, partners = scipy.optimize.linear_sum_assignment(padded, maximize=True)
    return tuple(
        (int(i), int(j)) for i, j in zip(rows, partners, strict=True) if j < m and allowed[i, j]
    )


def _ambiguous(
    pairs: tuple[tuple[int, int], ...], likeness: FloatArray, distance: FloatArray, margin: float
) -> tuple[tuple[int, int, int], ...]:
    """Pairs whose runner-up, near in frequency, is within the margin."""
    ambiguous = []
    for i, j in pairs:
        others = [k for k in range(likeness.shape[1]) if k != j and distance[i, k] <= np.log(1.5)]
        rivals = [k for k in others if likeness[i, k] > likeness[i, j] - margin]
        if rivals:
            ambiguous.append((i, j, max(rivals, key=lambda k: float(likeness[i, k]))))
    return tuple(ambiguous)


def _rows(name: str, values: ArrayLike) -> ComplexArray:
    rows = np.atleast_2d(np.asarray(values, dtype=complex))
    if rows.ndim != 2:
        raise InputError(name, f"has shape {rows.shape}, expected rows of vectors")
    if not np.all(np.isfinite(rows)):
        raise InputError(name, "holds NaN or infinite values")
    return rows


def _pair(name: str, a: ArrayLike, b: ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    left, right = _rows(name, a), _rows(name, b)
    if left.shape != right.shape:
        raise InputError(name, f"have shapes {left.shape} and {right.shape}, expected the same")
    return left, right


def _unit(rows: ComplexArray) -> ComplexArray:
    """Rows at unit length (scaled by their largest entry first, so that nothing overflows); NaN for
    zero rows.
    """
    largest = np.max(np.abs(rows), axis=1, keepdims=True, initial=0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        scaled = rows / largest
        return np.asarray(scaled / np.sqrt(np.sum(np.abs(scaled) ** 2, axis=1, keepdims=True)))


def _each_with_each(left: ComplexArray, right: ComplexArray) -> FloatArray:
    """(n, m) MAC of n rows with m others."""
    return np.asarray(np.minimum(np.abs(_unit(left).conj() @ _unit(right).T) ** 2, 1.0))


def _assurance(left: ComplexArray, right: ComplexArray, axis: int) -> FloatArray:
    cross = np.abs(np.sum(left.conj() * right, axis=axis)) ** 2
    return _ratio(
        cross, np.sum(np.abs(left) ** 2, axis=axis) * np.sum(np.abs(right) ** 2, axis=axis)
    )


def _ratio(top: FloatArray, bottom: FloatArray) -> FloatArray:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(bottom != 0, top / bottom, np.nan))
