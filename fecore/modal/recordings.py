"""Output-only identification, and that of FRFs of measured loads: modes of recordings.

`identify` takes half spectra (`fecore.signal.half_spectra`) as mobilities. What differs is what is
known beforehand.

Errors: all lines and pairs share the same few blocks. A segment of measured loads holds what is left
of the response to earlier ones, a free decay of the same modes: line by line this looks like noise
at each resonance, and hardly moves a pole. So poles are found as where no variance is known, and
their errors are what the groups of blocks move them by. About the poles θ̂ of the fit, with residues
and residual terms eliminated, the estimate of least squares changes with the spectra by

    θ̂ - θ = G (S⁺ - S̄⁺),   G = (JᵀWJ)⁻¹JᵀW,   cov θ = Σ_b δθ_b δθ_bᵀ,   δθ_b = w_b G (S⁺_b - S̄⁺)/(1 - h_b),

S⁺_b and w_b the mean of the blocks of group b and its share of the recording (after Döhler and
Mevel, Mech. Syst. Signal Process. 38, 2013). Loads come in gusts, and a group with the share h_b of
the power pulls the mean to itself by as much, so it is compared with the mean of the others (the
jackknife); Student's t has 1/Σh_b² - 1 degrees of freedom.

A pole is a harmonic, such as a machine's, where the window's rate is all its decay, and the
spectral kurtosis of the responses lies nearer to a sine's -1 than to a random response's 0.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.errors import IdentificationError, InputError
from fecore.findings import Finding, make, remark
from fecore.frf import POWER_OF_I_OMEGA, FrfSet
from fecore.modal.identify import Options, Report, identify
from fecore.modal.judge import Feature
from fecore.modal.result import Identification, IdentifiedPoles, named_mode
from fecore.modal.series import columns, derivatives, slope_parts, stacked
from fecore.modes import MeasuredModes
from fecore.signal.block_spectra import BlockSpectra, Motion
from fecore.signal.half_spectra import HalfSpectra, needed_s
from fecore.signal.measured_loads import LoadFrfs
from fecore.signal.stepped_sines import with_steps_joined

_NEARER_A_SINE = -0.5  # spectral kurtosis
_STEADY = 0.1  # of the window's rate: a mode's decay beside it that is hardly any

_OF_FORCES = frozenset(
    {"residues_turned", "channels_delayed", "few_lines_in_peak", "damping_uncertain"}
)
"""Findings that rest on a measured force, or on errors that are taken as independent."""

_OF_NEIGHBOURS = frozenset({"few_lines_in_peak", "noise_understated"})
"""Findings that take lines for neighbours: of steady loads each is measured by itself, without
leakage.
"""

finding = partial(
    make,
    {
        "harmonic": remark(
            "{hz:.3f} Hz is a harmonic: a steady sine in the responses, as of a machine; it is no"
            " mode, and one that lies there is hidden",
            subject="{hz:.3f} Hz",
        ),
        "recording_short": remark(
            "the recording of {length:.3g} s is short for the mode at {hz:.2f} Hz with"
            " {percent:.2g} % damping, whose correlation needs {needed:.3g} s",
            "record longer",
        ),
    },
)


@dataclass(frozen=True)
class OutputOnly:
    """Modes of responses alone. Their shapes are unscaled, as no force is known."""

    # its poles without the window's rate and with the covariance of the blocks, its notes with what
    # responses alone say; its fitted series as of the half spectra
    identification: Identification

    @property
    def harmonics_hz(self) -> tuple[float, ...]:
        """Steady sines in the responses, ascending."""
        return self.identification.harmonics_hz or ()


def identify_output_only(
    setups: HalfSpectra | Sequence[HalfSpectra],
    options: Options | None = None,
    report: Report = lambda _stage, _share: None,
) -> OutputOnly:
    """Natural frequencies, damping ratios and unscaled shapes from half spectra.

    1. Identify: the half spectra of all setups as FRFs, the unknown loads of each apart.
    2. Harmonics: parted from the modes.
    3. Findings: those that hold without a force, and which recording is short.

    Args:
        setups: of one recording, or of several that have references in common.
        options: as of `identify`.
        report: as of `identify`.

    Raises:
        InputError: setups have no reference in common, or windows of different rates.
        IdentificationError: no mode is supported.
    """
    setups = (setups,) if isinstance(setups, HalfSpectra) else tuple(setups)
    _check(setups)
    # 1. Identify.
    first = 1 if len(setups) > 1 else 0
    frfs = [setup.frfs(number) for number, setup in enumerate(setups, first)]
    identification, poles = _by_blocks(setups, frfs, options, report)
    before = identification.found
    # 2. Harmonics.
    sines = _sines(poles.frequency_hz, poles.damping_ratio, setups, poles.damping_sd)
    if sines.all():
        raise IdentificationError(
            "all poles are harmonics, steady sines as of a machine ("
            f"{', '.join(f'{hz:.3f} Hz' for hz in poles.frequency_hz)}), and none is a mode"
        )
    kept = replace(before, modes=poles).select(np.flatnonzero(~sines))
    harmonics = tuple(
        sorted([*poles.frequency_hz[sines].tolist(), *_refused_sines(identification, setups)])
    )
    # 3. Findings.
    numbers = _renumbered(before, kept, ~sines)
    notes = (
        *(finding("harmonic", hz=hz) for hz in harmonics),
        *_too_short(kept, setups),
        *_of_responses(identification.notes, numbers),
    )
    rms = _rms(setups, identification)
    done = replace(identification, found=kept, notes=notes)
    return OutputOnly(_of_spectra(replace(done, harmonics_hz=harmonics, response_rms=rms)))


_FRF = re.compile(r"\b(an )?FRF(s?)\b")


def _of_spectra(identification: Identification) -> Identification:
    """An identification that says of half spectra what `identify` says of FRFs."""

    def words(text: str) -> str:
        return _FRF.sub(lambda m: f"{'a ' if m[1] else ''}half spectr{'a' if m[2] else 'um'}", text)

    def reasons(features: Sequence[Feature]) -> tuple[Feature, ...]:
        return tuple(replace(each, words=words(each.words)) for each in features)

    found = identification.found
    return replace(
        identification,
        found=replace(
            found,
            features=tuple(map(reasons, found.features)),
            doubt=tuple(why and words(why) for why in found.doubt),
        ),
        refused=tuple(
            replace(each, why=each.why.reworded(words)) for each in identification.refused
        ),
        refused_poles=tuple(
            replace(each, reason=words(each.reason), features=reasons(each.features))
            for each in identification.refused_poles
        ),
        notes=tuple(each.reworded(words) for each in identification.notes),
    )


def _rms(
    setups: Sequence[HalfSpectra], identification: Identification
) -> tuple[Motion, float] | None:
    """Root mean square of the responses over the lines of the fit, each recording counting alike;
    None where recordings are of different quantities.
    """
    if len({setup.quantity for setup in setups}) > 1:
        return None
    low, high = identification.frequency_hz[[0, -1]]
    squares = [setup.mean_square(low, high) for setup in setups]
    return setups[0].quantity, float(np.sqrt(np.mean(squares)))


def identify_measured_loads(
    recordings: LoadFrfs | Sequence[LoadFrfs],
    options: Options | None = None,
    report: Report = lambda _stage, _share: None,
) -> Identification:
    """Natural frequencies, damping ratios and shapes from FRFs of measured loads.

    Args:
        recordings: of one structure, one or several.
        options: as of `identify`.
        report: as of `identify`.

    Raises:
        InputError: no recording, or windows of different rates.
        IdentificationError: no mode is supported.
    """
    recordings = (recordings,) if isinstance(recordings, LoadFrfs) else tuple(recordings)
    recordings = with_steps_joined(recordings)
    rates = sorted({each.window_rate_per_s for each in recordings})
    if len(rates) != 1:
        raise InputError(
            "recordings",
            f"carry windows of {', '.join(f'{rate:.3g}' for rate in rates) or 'no rate'} per second,"
            " expected one of all; state `lag_s`",
        )
    # without a window nothing is left of the response to earlier loads
    frfs = [each.frfs(with_variance=not each.window_rate_per_s) for each in recordings]
    identification, poles = _by_blocks(recordings, frfs, options, report)
    found, notes = replace(identification.found, modes=poles), identification.notes
    if not rates[0]:
        notes = tuple(each for each in notes if each.kind not in _OF_NEIGHBOURS)
    return replace(identification, found=found, notes=notes, window_taken_out_per_s=rates[0])


def _by_blocks(
    recordings: Sequence[BlockSpectra],
    frfs: Sequence[FrfSet],
    options: Options | None,
    report: Report,
) -> tuple[Identification, MeasuredModes]:
    """What the FRFs of recordings show, and its poles with the covariance that the scatter of the
    blocks shows, without the window's rate.
    """
    half = [each for each in recordings if isinstance(each, HalfSpectra)]
    identification = identify(frfs, options, report, half[0] if len(half) == 1 else None)
    covariance = scatter_of_blocks(identification, recordings)
    rate = recordings[0].window_rate_per_s
    return identification, without_window(identification.found.modes, covariance, rate)


def _check(setups: Sequence[HalfSpectra]) -> None:
    if not setups:
        raise InputError("setups", "is empty, expected at least one recording")
    lags = {(setup.lag_s, float(setup.frequency_hz[-1])) for setup in setups}
    if len(lags) > 1:
        raise InputError(
            "setups",
            f"have longest lags of {', '.join(f'{lag:g}' for lag, _ in sorted(lags))} s, expected"
            " one sampling rate and one lag of all; state `lag_s`",
        )
    together = set(setups[0].references)
    left = list(enumerate(setups))[1:]
    while left:
        joined = [each for each in left if together & set(each[1].references)]
        if not joined:
            raise InputError(
                "setups",
                f"setup {left[0][0] + 1} has no reference in common with the others, so that their"
                " shapes cannot be joined",
            )
        together |= {dof for _, setup in joined for dof in setup.references}
        left = [each for each in left if each not in joined]


def scatter_of_blocks(identification: Identification, setups: Sequence[BlockSpectra]) -> FloatArray:
    """(2m, 2m) covariance of f in Hz and ζ of the m poles found, with the window's rate: of the
    blocks, and of the drift between setups.
    """
    terms, power = identification.terms, POWER_OF_I_OMEGA[identification.quantity]
    omega, n = 2 * np.pi * identification.frequency_hz, terms.pairs
    basis, steep = columns(omega, terms, power), derivatives(omega, terms, power)
    measured = np.isfinite(identification.measured)
    root = np.where(measured, 1 / np.sqrt(identification.noise_variance), 0.0)
    deviations = _deviations(identification, setups)
    information = np.zeros((len(setups), 2 * n, 2 * n))
    moved = np.zeros((2 * n, sum(setup.weights.size for setup in setups)))
    score = np.zeros((len(setups), 2 * n))
    which = np.tile(np.arange(n), 2)
    for row, (weight, curve) in enumerate(zip(root, identification.predicted, strict=True)):
        off = np.where(measured[row], identification.measured[row] - curve, 0.0)
        modelled, residual = stacked(np.stack([curve, off], axis=1), weight).T
        frame, triangle = np.linalg.qr(stacked(basis, weight))
        linear = np.linalg.lstsq(triangle, frame.T @ modelled, rcond=None)[0]
        residues = linear[0 : 2 * n : 2] + 1j * linear[1 : 2 * n : 2]
        parts = slope_parts(terms, residues[None], np.arange(n))[0].reshape(2 * n, 2)
        slope = parts[:, 0] * steep[:, 2 * which] + parts[:, 1] * steep[:, 2 * which + 1]
        slope = stacked(slope, weight)
        slope -= frame @ (frame.T @ slope)
        number, place, blocks = deviations[row]
        information[number] += slope.T @ slope
        moved[:, place] += slope.T @ stacked(blocks.T, weight)
        score[number] += slope.T @ residual
    hz = identification.found.modes.frequency_hz
    own = [int(np.argmin(np.abs(terms.frequency_hz - each))) for each in hz]
    both = np.array([*own, *(n + k for k in own)])
    each = np.linalg.lstsq(information.sum(axis=0), moved, rcond=None)[0][both]
    each *= np.tile(np.concatenate([_factors(setup, hz) for setup in setups], axis=1), (2, 1))
    covariance: FloatArray = each @ each.T
    covariance[: len(own), : len(own)] += _drift_variance(information, score, own)
    scale = np.concatenate([hz, np.ones(len(own))])
    return covariance * np.outer(scale, scale)


def _drift_variance(information: FloatArray, score: FloatArray, own: list[int]) -> float:
    """Variance of the mean of S setups' drifts, which all frequencies have in common: the mean
    square of what ln f of the modes would have to change by in each, over S - 1.

    Args:
        information: (S, 2n, 2n) JᵀWJ of each setup.
        score: (S, 2n) JᵀW of each setup's residual.
        own: places of the modes among the n poles.
    """
    if len(information) == 1:
        return 0.0
    diagonal = np.diagonal(information, axis1=1, axis2=2)[:, own]
    drift = score[:, own].sum(axis=1) / diagonal.sum(axis=1)
    return float(np.mean(drift**2)) / (len(drift) - 1)


def _deviations(
    identification: Identification, setups: Sequence[BlockSpectra]
) -> list[tuple[int, slice, ComplexArray]]:
    """Of each pair of the fit, its setup, the places of that one's groups of blocks among all, and
    (G, L) what their spectra differ by from the mean.
    """
    pairs, begin = list[tuple[int, slice, ComplexArray]](), 0
    for number, setup in enumerate(setups):
        count = setup.weights.size
        place = np.searchsorted(setup.frequency_hz, identification.frequency_hz * (1 - 1e-9))
        off = (setup.blocks - setup.mean)[..., place].reshape(count, -1, place.size)
        pairs += [(number, slice(begin, begin + count), off[:, k]) for k in range(off.shape[1])]
        begin += count
    return [pairs[k] for k in identification.rows]


def _factors(setup: BlockSpectra, frequency_hz: FloatArray) -> FloatArray:
    """(m, G) of a mode's change by each group: its weight, the jackknife's 1/(1 - h) with h the
    share of the group in the power at the mode, and what takes the normal deviate to Student's with
    1/Σh² - 1 degrees of freedom.
    """
    place = [int(np.argmin(np.abs(setup.frequency_hz - hz))) for hz in frequency_hz]
    power = np.abs(setup.blocks[..., place]).sum(axis=(1, 2)).T * setup.weights
    share = power / power.sum(axis=1, keepdims=True)
    freedom = np.maximum(1 / np.sum(share**2, axis=1, keepdims=True) - 1, 1.0)
    t = scipy.stats.t.ppf(0.975, freedom) / scipy.stats.norm.ppf(0.975)
    return np.asarray(setup.weights / (1 - np.minimum(share, 0.5)) * t)


def without_window(
    modes: MeasuredModes, covariance: FloatArray | None, rate_per_s: float
) -> MeasuredModes:
    """The same poles without a window's rate, σ = ζω - β, which leaves the damped frequency as it
    is.

    A ratio that comes out below 0 is 0: a sine's, or one of large deviation.
    """
    omega, zeta = 2 * np.pi * modes.frequency_hz, modes.damping_ratio
    root = np.sqrt(1 - zeta**2)
    sigma, damped = zeta * omega - rate_per_s, omega * root
    size = np.hypot(sigma, damped)
    # by f and ζ
    of_sigma, of_damped = (2 * np.pi * zeta, omega), (2 * np.pi * root, -omega * zeta / root)
    of_size = [(sigma * a + damped * b) / size for a, b in zip(of_sigma, of_damped, strict=True)]
    of_ratio = [a / size - sigma * b / size**2 for a, b in zip(of_sigma, of_size, strict=True)]
    turn = np.block(
        [[np.diag(each) for each in row] for row in ([b / (2 * np.pi) for b in of_size], of_ratio)]
    )
    return replace(
        modes,
        frequency_hz=size / (2 * np.pi),
        damping_ratio=np.maximum(sigma / size, 0.0),
        covariance=None if covariance is None else turn @ covariance @ turn.T,
    )


def _sines(
    frequency_hz: FloatArray,
    damping_ratio: FloatArray,
    setups: Sequence[HalfSpectra],
    damping_sd: FloatArray | None,
) -> BoolArray:
    """(n,) which poles are harmonics: hardly any decay beside the window's, and a kurtosis nearer to
    a sine's in some setup.
    """
    omega = 2 * np.pi * frequency_hz
    least = _STEADY * setups[0].window_rate_per_s
    sd = np.zeros_like(omega) if damping_sd is None else damping_sd
    steady = damping_ratio * omega <= np.maximum(2 * omega * sd, least)
    return np.asarray(steady & (kurtosis_at(setups, frequency_hz) < _NEARER_A_SINE))


def kurtosis_at(setups: Sequence[HalfSpectra], frequency_hz: FloatArray) -> FloatArray:
    """(n,) spectral kurtosis at the nearest line, the least of all setups."""
    return np.array(
        [
            min(setup.kurtosis[int(np.argmin(np.abs(setup.frequency_hz - hz)))] for setup in setups)
            for hz in frequency_hz
        ]
    )


def _refused_sines(identification: Identification, setups: Sequence[HalfSpectra]) -> list[float]:
    """Frequencies of harmonics among the refused poles."""
    beta = setups[0].window_rate_per_s
    hz = np.array([each.frequency_hz for each in identification.refused_poles])
    zeta = np.array([each.damping_ratio for each in identification.refused_poles])
    if not hz.size:
        return []
    steady = _sines(hz, zeta - beta / (2 * np.pi * hz), setups, None)
    return [float(each) for each in hz[steady]]


def _too_short(poles: IdentifiedPoles, setups: Sequence[HalfSpectra]) -> list[Finding]:
    """Of the mode that decays most slowly, where its correlation has not decayed to 5 % at the
    longest lag.
    """
    modes, length = poles.modes, min(setup.length_s for setup in setups)
    needed = [
        needed_s(f, zeta) if zeta > 0 else 0.0
        for f, zeta in zip(modes.frequency_hz, modes.damping_ratio, strict=True)
    ]
    k = int(np.argmax(needed))
    if needed[k] <= length:
        return []
    zeta = 100 * modes.damping_ratio[k]
    slowest = {"hz": modes.frequency_hz[k], "percent": zeta, "needed": needed[k]}
    return [finding("recording_short", length=length, **slowest)]


def _renumbered(before: IdentifiedPoles, after: IdentifiedPoles, kept: BoolArray) -> dict[str, str]:
    """What `identify` calls modes, and what they are called without the harmonics among them."""
    numbers = np.cumsum([why is None for why in before.doubt])
    ours = np.cumsum([why is None for why in after.doubt])
    return {
        named_mode(int(numbers[k])): named_mode(int(new))
        for k, new in zip(np.flatnonzero(kept), ours, strict=True)
        if before.doubt[k] is None and numbers[k] != new
    }


def _of_responses(notes: Sequence[Finding], numbers: Mapping[str, str]) -> list[Finding]:
    """Findings of an identification that hold without a force, with the modes' numbers."""
    return [
        each.renamed(numbers) if numbers else each for each in notes if each.kind not in _OF_FORCES
    ]
