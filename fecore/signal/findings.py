"""All that can be said of hits and of the FRFs that were made of them, by its id."""

from functools import partial

from fecore.findings import make, remark

_CHANNEL = (
    "a sensitivity or a unit of the force or of the response is probably wrong, or the structure's"
    " density or geometry"
)
_BESIDE = "one beside its mark is refused there only where its FRF is unlike the others'"

OF_HITS = {
    "window_seen": remark(
        "the force's noise decays by {rate:.3g} ± {sd:.1g} per second in all hits: an exponential"
        " window that is not stated, and that is taken out like a stated one"
    ),
    "no_good_hit": remark(
        "no hit of point {points} is good, so there is no FRF; see the verdicts, and overrule where"
        " you know better"
    ),
    "single_hit": remark("a single good hit at point {points}: the FRF has no variance"),
    "response_late": remark(
        "the response seems to come {delay:.1f} ± {sd:.1f} µs after the force, which a fit takes"
        " for damping; state it as delay_s to take it out"
    ),
    "weak_excitation": remark(
        "the hammer excites the body up to {hz:.0f} Hz; above that the FRFs are mostly noise"
    ),
    "hits_not_located": remark(
        f"where the hits of point {{points}} landed does not show: {_BESIDE}"
    ),
    "hits_located_one_way": remark(
        f"where the hits of point {{points}} landed shows along one direction only: {_BESIDE}"
    ),
    "strip_height": remark(
        f"the FRFs are {{times}} what a strip of this mass and stiffness shows: {_CHANNEL}"
    ),
    "strip_damped": remark(
        "the FRFs are {times} what a strip of this mass and stiffness shows: {window} takes their"
        " resonances",
        "try a weaker one",
    ),
    "one_way": remark(
        "the FRF of point {response} hit at point {force} is {times} that of the opposite way, but"
        " a body answers alike both ways: one of the sensitivities is probably wrong"
    ),
    "above_the_rest": remark(
        "the FRFs of the hits at point {points} are {times:.2g} times as high as the median of all"
        " points: a sensitivity or range was probably changed there"
    ),
}
"""Of all hits of a campaign."""

finding = partial(make, OF_HITS)
"""A finding of these, with its values."""
