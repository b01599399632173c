"""What looks wrong with an elastic update, and what it means for the use of its result."""

from __future__ import annotations

import numpy as np

from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import REFUTED, ElasticResult
from fecore.updating.verdict import Finding, notes

SAME_SHAPE = 0.8
"""MAC below which two shapes are not taken to be those of one mode."""

FAR = 2.0  # prior standard deviations from the prior mean that are worth a warning
USUAL_MISS = 0.01  # of frequencies, root mean square: five times what plate theory misses of a body and its supports
HOPELESS_MISS = 0.03
"""The same, from which model and measurement do not belong together."""


def elastic_findings(elastic: ElasticResult, modes: MeasuredModes) -> list[Finding]:
    """All findings, by what they mean."""
    measured, model = modes.frequency_hz, elastic.updated.frequency_hz
    pairing = elastic.pairing
    alone = len(pairing.unpaired_measured)
    found = notes(pairing.messages(measured, model), None, 1)
    if elastic.unlike and pairing.mac is not None:
        text = (
            f"no measured mode is like any mode of the model (largest MAC {np.nanmax(pairing.mac):.2f}): this is not the model "
            "of what was measured; check that the file belongs to this structure, and boundary, points and frame. The likest "
            "modes are paired for a comparison alone"
        )
        found.append(Finding(text, "do_not_use", 110))
    if 2 * alone > len(modes):
        text = (
            f"{alone} of {len(modes)} measured modes have no partner in the model: this is not the model of what was measured; "
            "check that the file belongs to this structure, and boundary, points and frame"
        )
        found.append(Finding(text, "do_not_use", 100))
    elif alone:
        found.append(Finding(f"{alone} of {len(modes)} measured modes have no partner in the model", "with_care", 6))
    return [
        *found,
        *_rival_pairing(elastic),
        *_swinging_pairing(elastic),
        *_halves_of_modes(elastic, modes),
        *_unlike_shapes(elastic, modes),
        *_missed_frequencies(elastic),
        *_far_from_prior(elastic),
        *_confounded(elastic),
    ]


def _rival_pairing(elastic: ElasticResult) -> list[Finding]:
    """Other partners that the data hardly refute, and that would give another material."""
    names = elastic.layout.shared
    for rival in elastic.standing or elastic.rivals[:1]:
        apart, theta = rival.other.x - elastic.x, elastic.layout.material(rival.other.x)
        sd = np.sqrt(np.minimum(np.diag(elastic.mixture.total), np.diag(rival.other.mixture.total)))
        other = ", ".join(f"{name} {theta[i]:.3g}" for i, name in enumerate(names) if abs(apart[i]) > FAR * sd[i])
        if other and rival.evidence <= REFUTED:
            spanned = "; the intervals span both" if elastic.standing else ""
            text = (
                f"the modes may be others than those they were paired with: other partners, with {other}, are only "
                f"{rival.evidence:.1f} in log evidence behind{spanned}; shapes at more points would decide"
            )
            return [Finding(text, "with_care", 40)]
    return []


def _swinging_pairing(elastic: ElasticResult) -> list[Finding]:
    """Modes whose partners had to be held, as the fit from the prior means changed them to and fro."""
    if not elastic.torn:
        return []
    which = ", ".join(elastic.layout.campaigns[number].named(row) for number, row in elastic.torn)
    text = (
        f"the partner of measured mode {which} changed to and fro in the fit, as modes of the model cross there: each pairing "
        "was fitted alone, and the likeliest is the result; shapes at more points would decide"
    )
    return [Finding(text, "with_care", 30)]


def _halves_of_modes(elastic: ElasticResult, modes: MeasuredModes) -> list[Finding]:
    """Neighbours within their bandwidths, one of them without a like mode in the model: one mode that moved in the test."""
    matrix, partner, hz = elastic.pairing.mac, dict(elastic.pairing.pairs), modes.frequency_hz
    width = np.nan_to_num(modes.damping_ratio) * hz  # half of the bandwidth
    if matrix is None:
        return []
    like = [row in partner and matrix[row, partner[row]] >= SAME_SHAPE for row in range(len(modes))]
    halves = [
        row
        for row in range(len(modes) - 1)
        if hz[row + 1] - hz[row] < width[row] + width[row + 1] and not (like[row] and like[row + 1])
    ]
    if not halves:
        return []
    which = ", ".join(f"{row + 1} and {row + 2} ({hz[row]:.2f} and {hz[row + 1]:.2f} Hz)" for row in halves)
    text = (
        f"measured modes {which} lie within their bandwidths, and the model does not have both: so looks one mode of a "
        "structure that changed between the FRFs (temperature, supports, a sensor that moved); measure it faster or at one "
        "temperature, or leave one of them out of the mode set"
    )
    spoilt = elastic.misfit > HOPELESS_MISS or np.median([matrix[pair] for pair in partner.items()]) < SAME_SHAPE
    return [Finding(text, "do_not_use" if spoilt else "with_care", 105)]


def _unlike_shapes(elastic: ElasticResult, modes: MeasuredModes) -> list[Finding]:
    matrix, pairs = elastic.pairing.mac, elastic.pairing.pairs
    if matrix is None:
        return []
    values = np.array([matrix[pair] for pair in pairs])
    found = [
        f"measured mode {row + 1} ({modes.frequency_hz[row]:.2f} Hz) has only MAC {matrix[row, column]:.2f} with its "
        f"partner, model mode {column + 1} ({elastic.updated.frequency_hz[column]:.2f} Hz): check boundary, points and "
        "directions"
        for row, column in pairs
        if matrix[row, column] < SAME_SHAPE
    ]
    if np.median(values) < SAME_SHAPE:
        text = f"most measured shapes are unlike the model's (median MAC {np.median(values):.2f})"
        return [Finding(text, "do_not_use", 80), *notes(found, "with_care", 7)]
    return notes(found, "with_care", 7)


def _missed_frequencies(elastic: ElasticResult) -> list[Finding]:
    if elastic.misfit < USUAL_MISS:
        return []
    text = (
        f"the updated model misses the measured frequencies by {100 * elastic.misfit:.1f} % (rms), far more than plate theory "
        "does: a prior that is too sure, a constant fixed at a wrong value, or wrong geometry, density or boundary; the "
        "estimates are only as right as these"
    )
    return [Finding(text, "do_not_use" if elastic.misfit > HOPELESS_MISS else "with_care", 60)]


def _far_from_prior(elastic: ElasticResult) -> list[Finding]:
    prior, theta = elastic.updated.forward.parametrisation, elastic.theta
    away = elastic.x / elastic.layout.sd(elastic.scatter)
    texts = [
        f"{prior.names[i]} ended {abs(away[i]):.1f} prior standard deviations {'above' if away[i] > 0 else 'below'} its "
        f"prior mean ({theta[i]:.3g} against {prior.prior_mean[i]:.3g}): the prior or the model is wrong, and its interval "
        "supposes neither"
        for i in np.flatnonzero(np.abs(away) > FAR)
    ]
    return notes(texts, "with_care", 20)


def _confounded(elastic: ElasticResult) -> list[Finding]:
    texts = [
        f"{each.name} cannot be distinguished from {', '.join(each.confounded_with)}: the data fix a combination of them "
        "alone; fix one, or state how well it is known"
        for each in elastic.identifiability
        if each.confounded_with and each.name in elastic.layout.shared
    ]
    return notes(texts, "with_care", 10)
