"""What an identification hands on, and what a user should know of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.errors import IdentificationError
from fecore.findings import Finding, texts
from fecore.frf import Quantity
from fecore.modal.arrangement import FEW, QUANTITIES, SLOPE_SD, SURE, Arrangement, LinearPoles
from fecore.modal.findings import finding, lines_in_words
from fecore.modal.judge import Evidence, Feature, RefusedPole
from fecore.modal.prepare import Refused
from fecore.modal.refine import OUTLYING, PoleFit
from fecore.modal.series import Terms
from fecore.modal.shapes import Shapes
from fecore.modes import MeasuredModes
from fecore.signal.block_spectra import Motion

_FEW_LINES = 2.0  # lines in the half-power bandwidth below which the damping is not resolved
_COMPLEX = 0.8  # modal phase collinearity below which a mode is called complex
_WEAK = 0.1  # of the FRFs at its frequency, below which a mode is called weak
_CLOSE = 1.5  # distance of two modes in their mean bandwidth from which their shapes mix little
# of the lowest mode: where a driving point shows its asymptote, and lines that must be there
_BELOW, _FEWEST_BELOW = (0.05, 0.25), 5
_OPPOSITE = 0.8  # correlation below whose negative the residues of one FRF have the wrong sign
_MOVED = 3.0  # standard deviations from which a frequency changes with the height of hits
_FEW_OUTLIERS = 0.01  # share of a record that may be outliers
FREQUENCY_TOLERANCE = 0.01  # relative, between orders: the usual 1 % of stabilisation diagrams
DAMPING_TOLERANCE = 0.05  # relative, between orders: the usual 5 %


@dataclass(frozen=True)
class Stabilisation:
    """Data of the stabilisation diagram, one entry a pole."""

    order: IntArray  # (k,) model order
    frequency_hz: FloatArray  # (k,) natural frequency
    damping_ratio: FloatArray  # (k,) damping ratio
    frequency_stable: BoolArray  # (k,) True where a lower order has a pole within 1 % in frequency
    damping_stable: BoolArray  # (k,) True where that pole is also within 5 % in damping
    line_hz: FloatArray  # (L,) axis of the indicator
    indicator: FloatArray  # (L,) root of the sum of squares of all FRFs
    cmif: FloatArray  # (c, L) the complex mode indicator function, to be drawn behind the poles


@dataclass(frozen=True)
class FittedSeries:
    """The series fitted to all FRFs."""

    arrangement: Arrangement  # the FRFs without their drift
    fit: PoleFit  # of the poles that may be modes, or stand out of band or for much
    noise: FloatArray  # (N, L) variance of the FRFs' noise
    linear: LinearPoles  # the linear poles
    drift: FloatArray  # (N,) relative drift of each FRF's frequencies, all 0 where no drift pays
    full: bool  # whether the search had as many poles as it may

    @property
    def covariance(self) -> FloatArray:
        """(2n, 2n) covariance of (ln f, ζ).

        The mean of as many drifts as there are tests is common to all frequencies.
        """
        covariance, n = self.fit.parameter_covariance.copy(), self.fit.terms.pairs
        covariance[:n, :n] += self.drift.var() / self.arrangement.sessions
        return covariance

    @property
    def model_error(self) -> float:
        """Relative error of the FRFs beside the noise, from lines where they are large: root of
        Σ(|r|² - n²)|H|²/Σ|H|⁴.
        """
        measured, values = self.arrangement.measured, self.arrangement.values
        size = np.where(measured, np.abs(values) ** 2, 0.0)
        excess = (np.abs(self.fit.residual) ** 2 - self.noise) * size
        total = float(np.sum(size**2))
        return float(np.sqrt(max(float(np.sum(excess)), 0.0) / total)) if total > 0 else 0.0

    @cached_property
    def noise_ratio(self) -> float:
        """Mean square of the residual over the noise variance that came with the FRFs; where none did,
        χ² over its freedom.
        """
        known, fit = self.arrangement.known_noise, self.fit
        if not known.any():
            return fit.chi_squared / fit.freedom
        return float(np.mean(np.abs(fit.residual[known]) ** 2 / self.arrangement.variance[known]))

    def modes(self, kept: IntArray, probability: FloatArray, shapes: Shapes) -> MeasuredModes:
        """Poles with their shapes and the covariance of f and ζ."""
        f, zeta = self.fit.terms.frequency_hz, self.fit.terms.damping_ratio[kept]
        both = np.concatenate([kept, f.size + kept])
        scale = np.concatenate([f[kept], np.ones(kept.size)])  # from ln f to f
        covariance = self.covariance[np.ix_(both, both)] * np.outer(scale, scale)
        dofs = self.arrangement.roving
        return MeasuredModes(f[kept], zeta, shapes.complex, dofs, covariance, probability[kept])


@dataclass(frozen=True)
class IdentifiedPoles:
    """Poles with shapes: modes and uncertain ones, in ascending frequency."""

    # frequencies, damping, complex shapes at the roving dofs (positive directions), the
    # covariance of frequency and damping
    modes: MeasuredModes
    # the same shapes in full: realised, mass normalised, standard deviations, modal phase
    # collinearity
    shapes: Shapes
    # (n,) what χ² would rise by without the pole, in units of the price of its unknowns: 1 is just
    # worth it
    significance: FloatArray
    # n tuples of the reasons for and against, those that weigh most first
    features: tuple[tuple[Feature, ...], ...]
    doubt: tuple[str | None, ...]  # n reasons in words why a pole is uncertain; None for modes

    @property
    def probability(self) -> FloatArray:
        """(n,) that each pole is a mode."""
        assert self.modes.probability is not None, "an identification gives it"
        return self.modes.probability

    def select(self, which: IntArray) -> IdentifiedPoles:
        """Some of them, at least one."""
        modes, shapes, n = self.modes, self.shapes, len(self.modes)
        both = np.concatenate([which, n + which])
        return IdentifiedPoles(
            MeasuredModes(
                modes.frequency_hz[which],
                modes.damping_ratio[which],
                None if modes.shapes is None else modes.shapes[which],
                modes.dofs,
                None if modes.covariance is None else modes.covariance[np.ix_(both, both)],
                None if modes.probability is None else modes.probability[which],
            ),
            shapes.select(which),
            self.significance[which],
            tuple(self.features[int(k)] for k in which),
            tuple(self.doubt[int(k)] for k in which),
        )


@dataclass(frozen=True)
class Identification:
    """Modes identified from FRFs, and everything that a reader needs to judge them."""

    found: IdentifiedPoles  # modes and uncertain poles
    fitted: FittedSeries  # with one pole for each close pair
    terms: Terms  # the whole fitted series, with the poles out of band and the residual terms
    stabilisation: Stabilisation  # data of the stabilisation diagram
    # frequencies of the poles that were stated, as fitted, Hz, in the order of the statement
    stated: tuple[float, ...]
    used: tuple[str, ...]  # labels of the FRFs that were used, response first
    rows: IntArray  # (N,) their numbers among those handed in
    refused: tuple[Refused, ...]  # the FRFs that were not, with reasons
    refused_poles: tuple[RefusedPole, ...]  # in-band poles that are not modes, with reasons
    notes: tuple[Finding, ...]  # what a user should know
    frequency_hz: FloatArray  # (L,) lines of the fit
    quantity: Quantity  # what kind of FRF `measured` and `predicted` are
    # (N, L) the FRFs as used (signs turned to positive directions), NaN where not measured or
    # damaged
    measured: ComplexArray
    predicted: ComplexArray  # (N, L) the fitted FRFs
    noise_variance: FloatArray  # (N, L) variance E|n|² of each value, as handed in or estimated
    # mean weighted square of the residual over the noise variance: 1 where the model explains all
    # but noise. Exactly 1 by construction where the variance was estimated from the residual.
    noise_ratio: float
    # standard deviation of the relative error of the FRFs that lasts over several lines
    model_error: float
    drift: float  # standard deviation of the relative drift of the frequencies between the FRFs
    delay: float  # of the responses behind the forces, as the phases of the strong modes show it, s
    # number of lines that count as one independent line, by the correlation of the residual
    memory_lines: float
    seconds: dict[str, float]  # time of each step
    # steady sines in the responses, ascending, where nobody measured the loads: shapes are unscaled
    # then. None where they were measured.
    harmonics_hz: tuple[float, ...] | None = None
    # rate of the FRFs' exponential window that was taken out of the poles found, 1/s
    window_taken_out_per_s: float = 0.0
    # root mean square of all responses over the lines of the fit, in the SI unit of what they
    # measure, where nobody measured the loads; else None
    response_rms: tuple[Motion, float] | None = None

    def chosen(self, *, include_doubtful: bool = False) -> IdentifiedPoles:
        """The modes, with the uncertain poles where they are asked for.

        Raises:
            IdentificationError: all are uncertain, and they are not asked for.
        """
        which = np.flatnonzero([include_doubtful or why is None for why in self.found.doubt])
        if not which.size:
            f = self.found.modes.frequency_hz
            seen = "; ".join(
                f"{hz:.2f} Hz: {why}" for hz, why in zip(f, self.found.doubt, strict=True)
            )
            raise IdentificationError(
                f"all modes that the data show are uncertain ({seen}); include_doubtful or a lower"
                " threshold takes them"
            )
        return self.found.select(which)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The notes, in words."""
        return texts(self.notes)

    @property
    def modes(self) -> MeasuredModes:
        """The poles whose probability reaches the threshold."""
        return self.chosen().modes

    @property
    def shapes(self) -> Shapes:
        """Their shapes in full."""
        return self.chosen().shapes

    @property
    def doubtful(self) -> IdentifiedPoles | None:
        """The uncertain poles, with the reason of each."""
        which = np.flatnonzero([why is not None for why in self.found.doubt])
        return self.found.select(which) if which.size else None


def interference(fitted: FittedSeries, evidence: Evidence) -> BoolArray:
    """(N, L) values of which a tone is the larger part, and larger than their noise: they are no
    answer to the force.
    """
    part = fitted.fit.part(np.flatnonzero(np.repeat(evidence.tone, 2)))
    rest = np.abs(fitted.arrangement.values - part) ** 2
    return np.asarray(np.abs(part) ** 2 > np.maximum(fitted.fit.variance, rest))


def outlying(fit: PoleFit) -> BoolArray:
    """(N, L) single values that Student's law has left hardly any weight."""
    far = np.abs(fit.residual) ** 2 > OUTLYING * fit.variance
    isolated = far.copy()
    isolated[:, 1:] &= ~far[:, :-1]
    isolated[:, :-1] &= ~far[:, 1:]
    return np.asarray(
        isolated & (far.sum(axis=1, keepdims=True) <= np.maximum(1, _FEW_OUTLIERS * far.shape[1]))
    )


def of_series(fitted: FittedSeries, evidence: Evidence) -> tuple[Finding, ...]:
    """What a user should know of drift, a sensor's mass and phases."""
    drift, errors = fitted.drift, fitted.fit.errors
    return (
        *([finding("drift", percent=100 * drift.std())] if drift.any() else ()),
        *([finding("sensor_mass")] if errors is not None and errors.mean is not None else ()),
        *_of_phase(evidence),
    )


def _of_phase(evidence: Evidence) -> list[Finding]:
    if evidence.turned:
        return [finding("residues_turned")]
    if abs(evidence.delay) < 2e-5:
        return []
    side = "after" if evidence.delay > 0 else "before"
    return [finding("channels_delayed", delay=1e6 * evidence.delay, side=side)]


def left_out(
    arrangement: Arrangement, toned: BoolArray, outliers: BoolArray
) -> tuple[list[Finding], list[Finding]]:
    """The lines with interference, and the FRFs with outlying values and their lines."""
    where = lines_in_words(arrangement.frequency_hz[toned.any(axis=0)])
    of_interference = [finding("tones", lines=where)] if toned.any() else []
    rows = np.flatnonzero(outliers.any(axis=1))
    words = [lines_in_words(arrangement.frequency_hz[outliers[row]]) for row in rows]
    notes = [
        finding("outliers", frf=arrangement.label(int(row)), lines=lines)
        for row, lines in zip(rows, words, strict=True)
    ]
    more = len(notes) - 8
    if more <= 0:
        return of_interference, notes
    return of_interference, [*notes[:8], finding("more_outliers", count=more)]


def of_residual(fitted: FittedSeries) -> list[Finding]:
    """A residual that is clearly more than the noise."""
    ratio = fitted.noise_ratio
    clear = ratio >= 2 and fitted.arrangement.known_noise.any()
    return [finding("residual_large", times=np.sqrt(ratio))] if clear else []


def remarks(
    arrangement: Arrangement,
    fit: PoleFit,
    kept: IntArray,
    shapes: Shapes,
    share: FloatArray,
    doubt: tuple[str | None, ...],
    two: BoolArray,
) -> list[Finding]:
    """What a user should know of the poles that were kept, whose reasons for doubt are given, and
    which of all poles have the residues of two shapes.
    """
    named = _named(doubt)
    return [
        *_of_modes(
            arrangement, fit, kept, shapes=shapes, share=share[kept], doubt=doubt, named=named
        ),
        *_of_one_record(arrangement, fit, kept, named),
        *(
            finding("rank_two", which=which, hz=fit.terms.frequency_hz[k])
            for which, k in zip(named, kept, strict=True)
            if two[k]
        ),
        *_driving_points(arrangement, fit, kept),
        *_signs(arrangement, fit, kept),
        *_quantity_of_all(arrangement, fit, kept),
    ]


def _of_modes(
    arrangement: Arrangement,
    fit: PoleFit,
    kept: IntArray,
    shapes: Shapes,
    share: FloatArray,
    doubt: tuple[str | None, ...],
    named: list[str],
) -> Iterator[Finding]:
    """What a user should know of each pole by itself, and beside the one below it."""
    f, zeta = fit.terms.frequency_hz[kept], fit.terms.damping_ratio[kept]
    sd = np.sqrt(np.diag(fit.parameter_covariance))[fit.terms.pairs + kept]
    for k in range(f.size):
        of_mode = partial(finding, which=named[k], hz=f[k])
        if (why := doubt[k]) is not None:
            yield finding("mode_uncertain", hz=f[k], why=why)
        lines = 2 * zeta[k] * f[k] / max(arrangement.spacing_hz, np.finfo(float).tiny)
        if lines < _FEW_LINES:
            yield of_mode("few_lines_in_peak", lines=lines)
        if share[k] < _WEAK:
            yield of_mode("weak", percent=100 * share[k])
        if shapes.collinearity[k] < _COMPLEX:
            yield of_mode("complex_shape", collinearity=shapes.collinearity[k])
        if sd[k] > 0.1 * zeta[k]:
            yield of_mode("damping_uncertain", percent=100 * sd[k] / zeta[k])
        if k and (f[k] - f[k - 1]) < _CLOSE * (zeta[k] * f[k] + zeta[k - 1] * f[k - 1]) / 2:
            low, high = named[k - 1], named[k]
            yield finding("close_pair", low=low, high=high, first=f[k - 1], second=f[k])


def moved_by_height(fit: PoleFit, kept: IntArray) -> list[Finding]:
    """Kept poles whose frequency clearly changes with the height of hits."""
    if fit.errors is None or fit.errors.shift is None:
        return []
    by_chance = replace(fit, errors=replace(fit.errors, shift=None)).parameter_covariance
    shift, f = fit.errors.shift, fit.terms.frequency_hz
    return [
        finding(
            "not_linear",
            hz=f[k],
            way="falls" if shift[k] < 0 else "rises",
            percent=100 * abs(shift[k]),
        )
        for k in kept
        if abs(shift[k]) > _MOVED * np.sqrt(by_chance[k, k])
    ]


def named_mode(number: int) -> str:
    """A mode of a set in words."""
    return f"mode {number}"


def _named(doubt: tuple[str | None, ...]) -> list[str]:
    """Modes by their number in the set, which has no uncertain pole."""
    sure = np.cumsum([why is None for why in doubt])
    return [
        "an uncertain pole" if why else named_mode(int(number))
        for why, number in zip(doubt, sure, strict=True)
    ]


def _of_one_record(
    arrangement: Arrangement, fit: PoleFit, kept: IntArray, named: list[str]
) -> list[Finding]:
    """Poles that one of several FRFs shows: a mode and a resonance of that sensor have the same
    phase.
    """
    size = np.abs(fit.residues[:, kept]) ** 2
    if len(size) < 3:
        return []
    return [
        finding(
            "one_record",
            which=named[k],
            hz=fit.terms.frequency_hz[kept[k]],
            frf=arrangement.label(int(np.argmax(size[:, k]))),
        )
        for k in np.flatnonzero(size.max(axis=0) > 0.99 * size.sum(axis=0))
    ]


def _signs(arrangement: Arrangement, fit: PoleFit, kept: IntArray) -> Iterator[Finding]:
    """FRFs whose sign contradicts what the other fixed dofs see at the same roving dof.

    A = ψ lᵀ for each mode, so A_ij is A_ij' l_j/l_j', l_j/l_j' the regression of the fixed dofs over
    the other roving dofs. The sum over j' of this is taken: a wrong sign among three or more fixed
    dofs names its FRF alone, among two both.
    """
    roving, fixed = arrangement.row.T
    table = np.full((kept.size, len(arrangement.roving), len(arrangement.fixed)), 0j)
    table[:, roving, fixed] = (fit.terms.poles.imag * fit.residues)[:, kept].T
    if table.shape[1] < FEW or table.shape[2] < 2:
        return
    products = np.einsum("kij,kil->kijl", table, table.conj())
    others = products.sum(axis=1, keepdims=True) - products  # over the other roving dofs
    size = np.einsum("kijj->kij", others).real[:, :, None, :]
    expected = others / np.maximum(size, np.finfo(float).tiny) * table[:, :, None, :]
    expected = expected.sum(axis=3) - np.einsum("kijj->kij", expected)
    agreed = np.sum((expected.conj() * table).real, axis=0)
    most = np.linalg.norm(expected, axis=0) * np.linalg.norm(table, axis=0)
    for row in np.flatnonzero((agreed < -_OPPOSITE * most)[roving, fixed]):
        yield finding("opposite_sign", frf=arrangement.label(int(row)))


def _driving_points(arrangement: Arrangement, fit: PoleFit, kept: IntArray) -> list[Finding]:
    """A driving point has positive modal masses; where most come out negative, one of its signs is
    wrong.
    """
    notes = []
    turned = (2j * fit.terms.poles.imag * fit.residues)[:, kept]
    for row, (a, b) in enumerate(arrangement.pairs):
        if a != b:
            continue
        modal = turned[row].real
        # a phase of neither sign is that of another quantity, which the residues of all FRFs show
        if np.sum(np.abs(modal)) < np.sum(np.abs(turned[row].imag)):
            continue
        if modal.size and np.sum(modal[modal < 0]) < -0.5 * np.sum(np.abs(modal)):
            if (quantity := _other_quantity(arrangement, fit, kept, row)) is not None:
                notes.append(quantity)
                continue
            notes.append(
                finding(
                    "driving_point",
                    frf=arrangement.label(row),
                    negative=int(np.sum(modal < 0)),
                    count=modal.size,
                )
            )
    return notes


def _quantity_of_all(arrangement: Arrangement, fit: PoleFit, kept: IntArray) -> Iterator[Finding]:
    """That all FRFs are another quantity than stated, where no driving point shows it: the modal
    constants of a structure are about as large at high frequencies as at low ones, and a wrong ω² is
    their slope.
    """
    if any(a == b for a, b in arrangement.pairs) or kept.size < FEW:
        return
    pole = fit.terms.poles[kept]
    size = np.log(np.linalg.norm(fit.residues[:, kept] * pole.imag, axis=0))
    x = np.log(np.abs(pole))
    off = x - x.mean()
    slope = off @ size / (off @ off)
    rest = size - size.mean() - slope * off
    variance = rest @ rest / (x.size - 2) / (off @ off) + SLOPE_SD**2
    for p, how in ((-2, "fall with 1/ω²"), (2, "rise with ω²")):
        true = QUANTITIES.get(arrangement.power + p)
        if true and slope**2 - (slope - p) ** 2 > SURE * variance:
            times, stated = np.exp(p * x.mean()), arrangement.quantity
            yield finding("quantity_of_all", how=how, true=true, stated=stated, times=times)


def _other_quantity(
    arrangement: Arrangement, fit: PoleFit, kept: IntArray, row: int
) -> Finding | None:
    """That a driving point of negative modal masses is receptance stated as accelerance, or the
    other way, where its lines below the modes say so.

    Either turns the residues by 180°, as a wrong sign does. Below its modes a receptance is 1/k or
    -1/(mω²), an accelerance -ω²/k or 1/m: a wrong sign turns these too, a wrong quantity does not.
    """
    first, hz = fit.terms.frequency_hz[kept].min(), arrangement.frequency_hz
    low = arrangement.measured[row] & (hz > _BELOW[0] * first) & (hz < _BELOW[1] * first)
    if low.sum() < _FEWEST_BELOW:
        return None
    values, omega = arrangement.values[row, low], arrangement.omega[low]
    size = np.abs(values)
    slope = np.polyfit(np.log(omega), np.log(size + np.finfo(float).tiny), 1)[0]
    asymptotes = {
        (2, 0): (1, "are 1/k"),
        (2, -2): (-1, "fall with 1/ω²"),
        (0, 2): (-1, "rise with ω²"),
        (0, 0): (1, "are 1/m"),
    }
    sign, how = asymptotes.get((arrangement.power, round(float(slope))), (0, ""))
    if sign * np.sum(values.real) < 0.5 * np.sum(size):
        return None
    return finding(
        "driving_point_quantity",
        frf=arrangement.label(row),
        how=how,
        true="receptance" if arrangement.power else "accelerance",
        stated=arrangement.quantity,
    )


def diagram_of(arrangement: Arrangement, linear: LinearPoles) -> Stabilisation:
    """The diagram of the linear stage's poles, in ascending frequency."""
    at = np.argsort(np.abs(linear.pole), kind="stable")
    order, pole = linear.order[at], linear.pole[at]
    size = np.abs(pole)
    hz, zeta = size / (2 * np.pi), -pole.real / np.maximum(size, np.finfo(float).tiny)
    near, both = np.zeros(hz.size, dtype=bool), np.zeros(hz.size, dtype=bool)
    for below in np.unique(order)[:-1]:
        lower = order == below
        next_above = order == np.min(order[order > below])
        close, alike = _close(hz[next_above], hz[lower], zeta[next_above], zeta[lower])
        near[next_above] |= close
        both[next_above] |= alike
    return Stabilisation(
        order=order,
        frequency_hz=hz,
        damping_ratio=zeta,
        frequency_stable=near,
        damping_stable=both,
        line_hz=arrangement.frequency_hz,
        indicator=np.sqrt(np.sum(np.abs(arrangement.values) ** 2, axis=0)),
        cmif=mode_indicator(arrangement),
    )


def _close(
    hz: FloatArray, below_hz: FloatArray, zeta: FloatArray, below_zeta: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Whether each pole has one of the order below within the tolerance in frequency, and in
    damping as well.
    """
    off = np.abs(hz[:, None] / below_hz - 1) < FREQUENCY_TOLERANCE
    alike = np.abs(zeta[:, None] / below_zeta - 1) < DAMPING_TOLERANCE
    return np.asarray(off.any(axis=1)), np.asarray((off & alike).any(axis=1))


def mode_indicator(arrangement: Arrangement) -> FloatArray:
    """(c, L) the largest singular values of H(ω), roving by fixed dofs: as many are large at a line
    as modes are there (complex mode indicator function, Shih et al. 1988). With one fixed dof it is
    the root of the sum of squares. At most three, as of more modes at one frequency nobody reads
    off the number.
    """
    whole = np.zeros(
        (arrangement.frequency_hz.size, len(arrangement.roving), len(arrangement.fixed)),
        dtype=complex,
    )
    whole[:, arrangement.row[:, 0], arrangement.row[:, 1]] = arrangement.values.T
    gram = np.einsum("lpm,lpn->lmn", whole.conj(), whole)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(gram)[:, ::-1][:, :3], 0)).T
