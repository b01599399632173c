"""What looks wrong with an elastic update, and what it means for the use of its result."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fecore.arrays import ROUND_OFF
from fecore.body.constants import Parameter
from fecore.body.locate import place_in_words
from fecore.body.specimen import EDGE_ROUNDING
from fecore.findings import MOST_NAMED, Finding, Level, listed
from fecore.modes import MeasuredModes
from fecore.normal import Z_95
from fecore.updating.additions import MASS
from fecore.updating.contradictions import SLIPS, compare_sources
from fecore.updating.elastic_result import (
    BELIEVED,
    HOPELESS_MISS,
    REFUTED,
    SAME_SHAPE,
    ElasticResult,
    prior_inclusion,
)
from fecore.updating.explanations import left_open
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.parameters import constant_of
from fecore.updating.result import (
    Check,
    Conflict,
    ParameterEstimate,
    SourceStatement,
    amount,
    finding,
    modes_of,
    passed_on,
    plus_minus,
)

FAR = 2.0  # prior standard deviations from the prior mean that are worth a warning
# of frequencies, root mean square: five times what plate theory misses of a body and its supports
USUAL_MISS = 0.01

# standard deviations of a dimension from which a point of the grid beyond it contradicts it
_DOUBTED = 2.0
_HARDLY = 0.05  # probability of a change of stiffness below which none is reported
_MILLION = float(np.log(1e6))  # log odds beyond which a number says no more


def elastic_findings(elastic: ElasticResult, modes: MeasuredModes) -> list[Finding]:
    """All findings, by what they mean."""
    pairing, twins = elastic.pairing, _twins(elastic, modes)
    unpaired = len(pairing.unpaired_measured)
    twinned = {other for others in twins.values() for other in others}
    shown = replace(
        pairing,
        unpaired_model=tuple(column for column in pairing.unpaired_model if column not in twinned),
    )
    conflicts = compare_sources(elastic)[0]
    findings = passed_on("pairing", shown.notes(modes.frequency_hz, elastic.updated.frequency_hz))
    if elastic.unlike and pairing.mac is not None:
        findings.append(finding("no_like_mode", mac=np.nanmax(pairing.mac)))
    if unpaired:
        kind = "most_modes_alone" if 2 * unpaired > len(modes) else "modes_alone"
        findings.append(finding(kind, unpaired=modes_of(unpaired, len(modes))))
    return [
        *findings,
        *pairing_findings(elastic),
        *_two_in_one(elastic, modes, twins),
        *_halves_of_modes(elastic, modes),
        *_unlike_shapes(elastic),
        *_frequency_misfit(elastic),
        *mesh_findings(elastic),
        *map(contradiction, conflicts),
        *_changed(elastic),
        *_confounded(elastic),
        *_moved_by_length(elastic),
        *(
            []
            if any(each.cause.kind == "support" for each in conflicts)
            else _moved_by_support(elastic)
        ),
    ]


def pairing_findings(elastic: ElasticResult) -> list[Finding]:
    """Modes of one campaign or of several that may be others than those they were paired with."""
    return [*_rival_pairing(elastic), *_pairing_cycle(elastic), *_not_believed(elastic)]


def _not_believed(elastic: ElasticResult) -> list[Finding]:
    """Measured modes that are more likely none, as the model has no place for them."""
    findings, known = [], prior_inclusion(elastic.layout, elastic.pairings)[0]
    for campaign, pairing, at in zip(
        elastic.layout.campaigns, elastic.pairings, elastic.rows, strict=True
    ):
        rows = zip(
            pairing.pairs,
            known[at],
            elastic.problem.residual[at],
            elastic.problem.weights[at],
            strict=True,
        )
        findings += [
            finding(
                "mode_not_believed",
                which=campaign.named(row),
                probability=p,
                off=100 * np.expm1(residual),
            )
            for (row, _), p, residual, weight in rows
            if weight < BELIEVED
        ]
    return findings


def _rival_pairing(elastic: ElasticResult) -> list[Finding]:
    """Other partners that the data hardly refute, and that would give another material; or another
    material with the same.
    """
    names = elastic.layout.shared
    for rival in elastic.admissible_rivals or elastic.rivals[:1]:
        apart, theta = rival.other.x - elastic.x, elastic.layout.material(rival.other.x)
        sd = np.sqrt(np.minimum(np.diag(elastic.mixture.total), np.diag(rival.other.mixture.total)))
        other = ", ".join(
            f"{name} {amount(name, theta[i])}"
            for i, name in enumerate(names)
            if abs(apart[i]) > FAR * sd[i]
        )
        if other and rival.evidence <= REFUTED:
            spanned = "; the intervals span both" if elastic.admissible_rivals else ""
            if rival.other.partners == elastic.partners:
                return [
                    finding(
                        "rival_constants", other=other, evidence=rival.evidence, spanned=spanned
                    )
                ]
            return [finding("rival_pairing", other=other, evidence=rival.evidence, spanned=spanned)]
    return []


def _pairing_cycle(elastic: ElasticResult) -> list[Finding]:
    """Modes whose partners had to be held, as the fit from the prior means changed them to and
    fro.
    """
    which = ", ".join(
        elastic.layout.campaigns[number].named(row) for number, row in elastic.oscillating_modes
    )
    return [finding("partners_swing", which=which)] if which else []


def _twins(elastic: ElasticResult, modes: MeasuredModes) -> dict[int, list[int]]:
    """Modes of the model without a partner within half a bandwidth of a measured mode's partner, by
    the measured mode.
    """
    model, pairing = elastic.updated.frequency_hz, elastic.pairing
    twins = dict[int, list[int]]()
    for row, column in pairing.pairs:
        half = np.nan_to_num(modes.damping_ratio[row]) * modes.frequency_hz[row]
        if others := [k for k in pairing.unpaired_model if abs(model[k] - model[column]) < half]:
            twins[row] = others
    return twins


def _two_in_one(
    elastic: ElasticResult, modes: MeasuredModes, twins: dict[int, list[int]]
) -> list[Finding]:
    """Measured modes where the body has two that lie too close together to be separated."""
    model, partner = elastic.updated.frequency_hz, dict(elastic.pairing.pairs)
    return [
        finding(
            "two_in_one",
            which=f"{row + 1} ({modes.frequency_hz[row]:.2f} Hz)",
            hz=" and ".join(f"{hz:.2f} Hz" for hz in np.sort(model[[partner[row], *others]])),
        )
        for row, others in twins.items()
    ]


def _halves_of_modes(elastic: ElasticResult, modes: MeasuredModes) -> list[Finding]:
    """Neighbours within their bandwidths, for which the model has one like mode: one mode that
    moved in the test.
    """
    matrix, partner, hz = elastic.pairing.mac, dict(elastic.pairing.pairs), modes.frequency_hz
    model = elastic.updated.frequency_hz
    width = np.nan_to_num(modes.damping_ratio) * hz  # half of the bandwidth
    if matrix is None:
        return []
    like = [row in partner and matrix[row, partner[row]] >= SAME_SHAPE for row in range(len(modes))]
    halves = [
        row
        for row in range(len(modes) - 1)
        if hz[row + 1] - hz[row] < width[row] + width[row + 1]
        and not (like[row] and like[row + 1])
        and np.sum((model > hz[row] - width[row]) & (model < hz[row + 1] + width[row + 1])) < 2
    ]
    if not halves:
        return []
    which = ", ".join(
        f"{row + 1} and {row + 2} ({hz[row]:.2f} and {hz[row + 1]:.2f} Hz)" for row in halves
    )
    spoilt = (
        elastic.misfit > HOPELESS_MISS
        or np.median([matrix[pair] for pair in partner.items()]) < SAME_SHAPE
    )
    return [finding("halves_of_a_mode", level="do_not_use" if spoilt else None, which=which)]


def _unlike_shapes(elastic: ElasticResult) -> list[Finding]:
    matrix, pairs, hz = elastic.pairing.mac, elastic.pairing.pairs, elastic.updated.frequency_hz
    if matrix is None:
        return []
    median = float(np.median([matrix[pair] for pair in pairs]))
    findings = [finding("shapes_unlike", mac=median)] if median < SAME_SHAPE else []
    return findings + [
        finding(
            "shape_unlike", which=elastic.only.named(i), mac=matrix[i, j], model=j + 1, hz=hz[j]
        )
        for i, j in pairs
        if matrix[i, j] < SAME_SHAPE
    ]


def _frequency_misfit(elastic: ElasticResult) -> list[Finding]:
    if elastic.misfit < USUAL_MISS:
        return []
    level: Level | None = "do_not_use" if elastic.misfit > HOPELESS_MISS else None
    return [finding("frequencies_missed", level=level, percent=100 * elastic.misfit)]


def mesh_findings(elastic: ElasticResult) -> list[Finding]:
    """Where the bodies' own meshes would have given other constants, and which a finer one still
    decides.
    """
    shared, findings = elastic.layout.shared, []
    errors = [
        error
        for campaign in elastic.layout.campaigns
        if (error := campaign.forward.mesh_error) is not None
    ]
    if not errors:
        return []
    sd = np.sqrt(np.diag(elastic.model_averaged_posterior.total) + elastic.by_mesh)[: len(shared)]
    shift = elastic.on_own_mesh[: len(shared)]
    theta = elastic.layout.material(elastic.x)
    moved = [i for i in np.argsort(-np.abs(shift) / sd) if abs(shift[i]) > sd[i]]
    if moved:
        log = elastic.layout.prior.logarithmic
        share = [np.expm1(shift[i]) if log[i] else shift[i] / theta[i] for i in moved]
        coarsest = max(errors, key=lambda error: error.size)
        enough = coarsest.size_for(float(sd[moved[0]] / abs(shift[moved[0]])) / 2)
        findings.append(
            finding(
                "mesh_moves",
                size=1e3 * coarsest.size,
                finest=1e3 * coarsest.finest,
                moved=listed(
                    [
                        f"{shared[i]} by {100 * each:+.2g} %"
                        for i, each in zip(moved, share, strict=True)
                    ],
                    MOST_NAMED,
                ),
                enough=1e3 * enough,
            )
        )
    decided = [
        name
        for i, name in enumerate(shared)
        if elastic.by_mesh[i] > sd[i] ** 2 / 2 and _is_lost(elastic, i)
    ]
    if decided:
        findings.append(finding("mesh_decides", names=listed(decided, MOST_NAMED)))
    return findings


def _is_lost(elastic: ElasticResult, number: int) -> bool:
    return not elastic.identifiability[number].identifiable


def mesh_on_trust(forward: ForwardModel) -> list[Finding]:
    """That nobody knows what a body's mesh misses."""
    body = forward.specimen
    if not body.has_elements:
        return [finding("mesh_on_trust", why="matrices have no elements that could be refined")]
    if body.in_space is None or forward.finer is not None:
        return []
    nodes = len(body.in_space.mesh.nodes)
    return [finding("mesh_on_trust", why=f"it is too large to be refined ({nodes} nodes)")]


def contradiction(conflict: Conflict) -> Finding:
    """What contradicts the other data, which causes are as likely, and what is cleared."""
    cause = conflict.cause
    rivals = listed([_explained(each) for each in conflict.rivals], MOST_NAMED)
    cleared = listed(conflict.cleared, MOST_NAMED)
    return finding(
        "sources_conflict",
        level="do_not_use" if cause.kind == "campaign" or conflict.moved > Z_95 else None,
        source=cause.name,
        cause=f"{_explained(cause)}{_odds(conflict)}",
        p=cause.p,
        rivals=f"; nearly as likely: {rivals}" if rivals else "",
        cleared=f"; it also explains what contradicts {cleared}" if cleared else "",
    )


def _explained(check: Check) -> str:
    """A cause as a sentence says it:
    `length of campaign B as 291.2 ± 1.6 mm instead of 300 ± 0.5 mm`.
    """
    if check.kind == "campaign":
        return f"{check.name} as one of another material, angle or boundary than stated"
    if check.kind in ("mass", "foot", "support"):
        sizes = listed([_sized(statement) for statement in check.said], MOST_NAMED)
        verb = ", which gives way" if check.kind == "support" else " of"
        return f"{check.name}{verb} {sizes} near {place_in_words(check.place)}"
    if check.kind == "stiffness":
        (statement,), (of, where) = check.said, check.stretch
        return (
            f"{check.name}, {of} at {statement.rest:.2f} ± {statement.rest_sd:.2f} of it between {where},"
            f" which is said of at most {100 * check.level:.1g} % of sound bodies"
        )
    if check.kind == "scatter":
        (statement,) = check.said
        return (
            f"specimens that scatter by {100 * statement.rest:.2g} % instead of"
            f" {100 * statement.stated:.2g} %"
        )
    several, words = len(check.said) > 1, []
    for statement in check.said:
        estimated, stated = (
            plus_minus(statement.constant, *each)
            for each in (
                (statement.rest, statement.rest_sd),
                (statement.stated, statement.stated_sd),
            )
        )
        words.append(
            f"{statement.constant + ' ' if several or check.kind == 'coupons' else ''}as {estimated} instead"
            f" of {stated}"
        )
    return f"{check.name}{': ' if check.kind == 'coupons' else ' '}{listed(words, MOST_NAMED)}"


def _sized(statement: SourceStatement) -> str:
    """The size of what a body may have: `5.4 ± 0.2 g`, `in rotation about y with 82 ± 2
    N·m/rad`.
    """
    if statement.constant == MASS:
        return f"{1e3 * statement.rest:.1f} ± {1e3 * statement.rest_sd:.1f} g"
    return sized(statement.constant, f"{statement.rest:.3g} ± {statement.rest_sd:.2g}")


def sized(name: str, stiffness: str) -> str:
    """A stiffness of a foot or a support by its name: `in rotation about y with 82 N·m/rad`,
    `of support 2 along z with …`.
    """
    *number, dof = name.split("_")[1:] or [name]
    of = f"of support {number[0]} " if number else ""
    if dof in ("u", "v", "w"):
        return f"{of}along {'xyz'['uvw'.index(dof)]} with {stiffness} N/m"
    if dof in ("rx", "ry", "rz"):
        return f"{of}in rotation about {dof[1]} with {stiffness} N·m/rad"
    return f"{stiffness} N/m"


def _odds(conflict: Conflict) -> str:
    """How far the cause is ahead of the next explanation."""
    if conflict.odds is None or conflict.odds <= 0:
        return ""
    times = f"{np.exp(conflict.odds):.2g}" if conflict.odds < _MILLION else "over a million"
    return f" ({times} to 1 ahead of the next)"


def _changed(elastic: ElasticResult) -> list[Finding]:
    """Where the stiffness has changed, and where the resolution ends; nothing where it hardly
    has.
    """
    intervals = elastic.damage_intervals
    if intervals is None or intervals.probability < _HARDLY:
        return []
    begin, end, least, most = (1e3 * value for value in intervals.extent())
    return [
        finding(
            "stiffness_changed",
            p=intervals.probability,
            begin=begin,
            end=end,
            least=least,
            most=most,
        )
    ]


def _confounded(elastic: ElasticResult) -> list[Finding]:
    """Constants that move with others; a coefficient of temperature by which they were brought
    elsewhere is none of these.
    """
    others = {
        each.name: [name for name in each.confounded_with if constant_of(name) is None]
        for each in elastic.identifiability
        if each.name in elastic.layout.shared
    }
    return [
        finding("confounded", name=name, others=", ".join(rest))
        for name, rest in others.items()
        if rest
    ]


def _moved_by_length(elastic: ElasticResult) -> list[Finding]:
    """How a slip of the stated length that the modes would not show moves the constants, where by
    more than their intervals.

    Of the posterior covariance C and the prior's variance σ² the rest of the data say length by v =
    1/(1/C_nn - 1/σ²), and a constant follows a length that is held by C_pn/C_nn.
    """
    layout, C = elastic.layout, elastic.inverse
    if "length" not in layout.labels:
        return []
    place = layout.labels.index("length")
    left = 1 - C[place, place] / layout.sd(elastic.scatter)[place] ** 2
    rest = float(np.sqrt(C[place, place] / max(left, ROUND_OFF)))
    slopes = C[: len(layout.shared), place] / C[place, place]
    sd = np.sqrt(np.diag(elastic.model_averaged_posterior.total)[: len(layout.shared)])
    moved = [
        f"{name} by {100 * np.expm1(slope * np.log(1.01)):+.2g} %"
        for name, slope, own, each in zip(
            layout.shared, slopes, sd, elastic.identifiability, strict=False
        )
        if each.identifiable and abs(slope) * rest > Z_95 * own
    ]
    return (
        [finding("length_moves", rest=100 * rest, moved=listed(moved, MOST_NAMED))] if moved else []
    )


def _moved_by_support(elastic: ElasticResult) -> list[Finding]:
    """How a support that gives way as far as the data leave open moves the constants, where by more
    than their intervals.
    """
    open_end = left_open(elastic, SLIPS)
    if open_end is None:
        return []
    q, move = len(elastic.layout.shared), open_end.move
    sd = np.sqrt(
        np.diag(elastic.model_averaged_posterior.total)
        + elastic.systematic_variance(*elastic.all_systematic_effects)
    )[:q]
    moved = [
        f"{name} by {100 * (np.expm1(each) if log else each / theta):+.2g} %"
        for name, each, own, log, theta, known in zip(
            elastic.layout.shared,
            move,
            sd,
            elastic.layout.prior.logarithmic,
            elastic.layout.material(elastic.x),
            elastic.identifiability,
            strict=False,
        )
        if known.identifiable and abs(each) > Z_95 * own
    ]
    if not moved:
        return []
    stiffness = sized(open_end.support.name, f"{open_end.stiffness:.2g}")
    level: Level | None = "with_care" if open_end.favoured else None
    return [
        finding("support_moves", level=level, stiffness=stiffness, moved=listed(moved, MOST_NAMED))
    ]


def undetermined(
    constants: Sequence[ParameterEstimate],
    parameters: Sequence[Parameter] | None,
    usual: Sequence[Parameter] = (),
) -> list[Finding]:
    """Constants that a recipe asks for and the data do not determine; or that they determine none.

    A recipe that names none, or only the usual ones, asks for what the data determine.
    """
    lost = [each.name for each in constants if each.tied_to is None and not each.identifiable]
    if not any(each.identifiable for each in constants):
        return [finding("nothing_determined")] if constants else []
    requested, known = (
        {each.name for each in some if not (each.fixed or each.tied_to)}
        for some in (parameters or (), usual)
    )
    names = [name for name in lost if name in requested and requested != known]
    return [finding("not_determined", names=listed(names, MOST_NAMED))] if names else []


def points_beyond(forward: ForwardModel, inputs: Inputs, campaign: str = "") -> list[Finding]:
    """Which points of the grid contradict the length or the width; of a campaign that is named
    where there are several.

    A tape, a drawing and a calliper differ by millimetres, so the model has a point that lies a
    little further out on its edge (`fecore.body.specimen.BEYOND_EDGE`). Beyond what the dimension
    is known to, the dimension or the point is wrong.
    """
    nominal, (x, y, _) = forward.specimen.nominal, forward.places.T
    of = f"campaign {campaign}" if campaign else ""
    where, findings = f"{of}: " if of else "", []
    for name in forward.specimen.outline:
        size = nominal[name]
        out = np.maximum(-x, x - size) if name == "length" else np.abs(y) - size / 2
        limit = max(_DOUBTED * inputs.standard_deviation(name, size), EDGE_ROUNDING * size)
        if (rows := np.flatnonzero(out > limit)).size:
            points = listed([forward.points[row] for row in rows], MOST_NAMED)
            values = {"points": points, "name": name, "size": 1e3 * size, "out": 1e3 * out.max()}
            findings.append(finding("points_beyond", campaign=of, where=where, **values))
    return findings
