"""All that a user may have to know of a result, one table: what it means for the use of the result,
the sentence, what to do about it and where.

A row has a level (None: it means nothing for the use) and a weight: within a level, more comes
first.
"""

from typing import Literal, NamedTuple

Level = Literal["with_care", "do_not_use"]

Place = Literal["campaign", "modes", "structure", "update", "frfs", "damping"]
"""Where a finding is mended."""


class Row(NamedTuple):
    """A row of the table; with names for numbers in braces."""

    level: Level | None
    weight: float
    sentence: str
    advice: str = ""  # what to do, within the finding's own text
    # where that is done, for a page to lead there; None where a result states it as a note
    link: Place | None = None
    remedy: str = ""  # what to do, where a page has no other advice


_ANOTHER_BODY = "check that the file belongs to this structure, and boundary, points and frame"
_DECIDE = "shapes measured at more points would decide"
_WINDOW = "state the window's rate 1/τ with the campaign, 0 for none"
_FRFS = "(in brackets: its factor relative to all FRFs); correct or leave out"

FINDINGS = {
    # of the measurement and the model
    "measurement": Row(None, 0.5, "{text}"),
    "mesh_misses": Row(
        "with_care",
        8,
        "the finest mesh allowed, {nx} × {ny} elements, may give frequencies that are wrong by"
        " {percent:.2g} %",
        "choose a band that ends lower",
        link="update",
    ),
    "mesh_moves": Row(
        None,
        7,
        "on the model's own mesh, of elements of {size:.2g} mm, the result would move: {moved}; the"
        " constants are those of elements of {finest:.2g} mm",
        "elements of {enough:.2g} mm would do",
        link="structure",
    ),
    "mesh_decides": Row(
        "with_care",
        20,
        "the mesh decides {names}, whatever was measured",
        "make its elements smaller, and its facets as many as the curve needs",
        link="structure",
    ),
    "mesh_on_trust": Row(
        None,
        1,
        "what the model's mesh misses is not known, as {why}: it is taken on trust, and is in no"
        " interval",
        link="structure",
        remedy="Compare its frequencies with those of a finer mesh in the program that it is of.",
    ),
    "without_joints": Row(
        None,
        4,
        "walls of the model meet at their middle surfaces without a model of their joint, as the"
        " recipe has it: each frequency may be wrong by {percent:.2g} %",
        "constants found so belong to models without joints",
    ),
    "points_beyond": Row(
        "with_care",
        9,
        "{where}points {points} lie beyond the {name} of {size:g} mm, by up to {out:.2g} mm",
        "the {name} or the points' coordinates are wrong, and so may be the constants; correct what"
        " is wrong",
        link="structure",
    ),
    "joint_needs_frfs": Row(
        "with_care",
        1,
        "the method joint needs FRFs, and the campaign has none",
        "the constants were estimated from the modes, as the method two_stage does",
        link="campaign",
        remedy="Import the FRFs for a joint update.",
    ),
    "roving_sensor": Row(
        "with_care",
        1,
        "the sensor of {grams:.3g} g moved with the response, so its mass shifts the modes from FRF"
        " to FRF: the constants, and the modes without the sensor, were estimated from the FRFs"
        " with a model that carries it, as the method joint does{unused}",
        link="campaign",
        remedy="State the sensor's grid point if it stood still.",
    ),
    # of the modes
    "pairing": Row(None, 1, "{text}"),
    "no_like_mode": Row(
        "do_not_use",
        110,
        "no measured mode shape agrees with one of the model (largest MAC {mac:.2f}): the model is"
        " not one of the structure that was measured",
        _ANOTHER_BODY + ". The modes that agree best are paired for comparison only",
        link="campaign",
    ),
    "halves_of_a_mode": Row(
        "with_care",
        105,
        "measured modes {which} lie closer together than their bandwidths, and the model has only"
        " one mode there: probably one mode, of a structure that changed between the FRFs"
        " (temperature, supports, a sensor that was moved)",
        "measure faster or at a constant temperature, or leave one of the two out of the mode set",
        link="modes",
    ),
    "two_in_one": Row(
        None,
        3,
        "measured mode {which} is probably two: the model has modes at {hz}, closer together than"
        " half a bandwidth, which the FRFs do not separate. Its frequency is of both, its shape and"
        " damping are a mixture",
        "hit or sense at a second place, where one of the two stands still",
        link="modes",
    ),
    "most_modes_alone": Row(
        "do_not_use",
        100,
        "{unpaired} no partner in the model: the model is not one of the structure that was measured",
        _ANOTHER_BODY,
        link="campaign",
    ),
    "modes_alone": Row(
        "with_care",
        6,
        "{unpaired} no partner in the model",
        link="modes",
        remedy="Leave in-plane modes out of the mode set, and check boundary, frame and geometry.",
    ),
    "mode_not_believed": Row(
        None,
        2,
        "measured mode {which}, which is a mode with probability {probability:.2f}, lies {off:+.2f}"
        " % off its partner in the model and is left out",
        "look at it in the FRFs, and drop or keep it in the mode set",
        link="modes",
    ),
    "shapes_unlike": Row(
        "do_not_use",
        80,
        "most measured mode shapes disagree with the model's (median MAC {mac:.2f})",
        link="campaign",
        remedy="Check boundary, geometry, frame and numbering of the points.",
    ),
    "shape_unlike": Row(
        "with_care",
        7,
        "measured mode {which} agrees poorly with its partner, model mode {model} ({hz:.2f} Hz):"
        " MAC {mac:.2f}",
        "check boundary, points and directions",
        link="campaign",
    ),
    "rival_pairing": Row(
        "with_care",
        40,
        "the measured modes may be paired with the wrong modes of the model: another pairing, which"
        " gives {other}, is nearly as likely (its log evidence is lower by"
        " {evidence:.1f}){spanned}",
        _DECIDE,
        link="campaign",
    ),
    "partners_swing": Row(
        "with_care",
        30,
        "the partner of measured mode {which} alternated during the fit, because modes of the model"
        " cross there: each pairing was fitted separately, and the most likely one is reported",
        _DECIDE,
        link="campaign",
    ),
    # of the constants
    "frequencies_missed": Row(
        "with_care",
        60,
        "the frequencies of the updated model differ from the measured ones by {percent:.1f} %"
        " (rms), far more than the error of plate theory: a prior is too narrow, a constant fixed"
        " at a wrong value, or geometry, density or boundary wrong",
        "find the cause before you use the estimates",
        link="structure",
    ),
    "stiffness_changed": Row(
        None,
        4,
        "with a probability of {p:.2g} the stiffness has changed between x = {begin:.3g} and"
        " {end:.3g} mm, over {least:.3g} to {most:.3g} mm of that: the modes do not resolve it"
        " further, so the factor of a zone is the mean over the zone",
        "more modes would narrow it",
        link="campaign",
    ),
    "confounded": Row(
        None,
        3,
        "{name} cannot be distinguished from {others}: the data determine only a combination of"
        " them",
        "fix one of them, or state how well it is known",
        link="update",
    ),
    "not_determined": Row(
        "with_care",
        10,
        "the recipe asks for {names}, which the data do not determine: what is given is the prior",
        "leave out what you do not need, measure a wider band, or state a better prior",
        link="update",
    ),
    "nothing_determined": Row(
        "with_care",
        10,
        "the data determine none of the constants: what is given is the prior",
        "measure a wider band, or at more points",
        link="update",
    ),
    "samples_differ": Row(
        "with_care",
        5,
        "the sampled posterior of {name} is {ratio:.2f} times as wide as its Laplace approximation",
        "use the samples",
        link="update",
    ),
    "length_moves": Row(
        None,
        1.2,
        "the modes show the length to ± {rest:.2g} % alone: a length 1 % longer than stated would"
        " change {moved}",
        "measure it twice",
        link="structure",
    ),
    "support_moves": Row(
        None,
        1.1,
        "the support may give way {stiffness} for all that the modes say: that would change"
        " {moved}",
        link="campaign",
        remedy="Measure shapes at points near the support, or how firm it is; or hold it more firmly.",
    ),
    # of the FRFs
    "frfs_unlike": Row(
        "do_not_use",
        90,
        "most FRFs disagree with the model's (median agreement {likeness:.2f}, 1 would be perfect):"
        " a wrong boundary, geometry, frame or numbering of the points",
        "find the cause before you use the estimates",
        link="campaign",
    ),
    "modes_absent": Row(
        "with_care",
        85,
        "the model has {modes} at {which} that the FRFs should show clearly, and they show none"
        " there",
        "the boundary or the geometry is wrong, or modes were paired wrongly",
        link="campaign",
        remedy="Check boundary and geometry, and the pairs in the table of modes.",
    ),
    "sign_opposite": Row(
        "with_care",
        30,
        "most FRFs have the opposite sign of the model's: the hammer or the sensor has another"
        " direction or polarity than stated",
        "the damping was fitted to the FRFs with their sign reversed",
        link="campaign",
        remedy="Correct the direction or polarity of hammer or sensor in the file.",
    ),
    "frfs_scaled": Row(
        "with_care",
        30,
        "the FRFs are {factor} times as large as the model's{unit}: check calibration (hammer,"
        " sensor, units), geometry, density, added masses and boundary",
        "the damping was fitted to the FRFs divided by this factor",
        link="campaign",
        remedy="Correct what is wrong: the constants are wrong with it.",
    ),
    "frfs_scaled_by_place": Row(
        None,
        3,
        "the FRFs are {factor} times as large as the model's{unit}: the sensor, or the hammer, that"
        " stood still is some millimetres off its point, near which the modes are steep, or its"
        " calibration is wrong",
        "measure where it is; the damping was fitted to the FRFs divided by this factor",
        link="campaign",
    ),
    "frf_turned": Row(
        "with_care",
        30,
        f"{{who}} the opposite sign of the {{of}}'s: a wrong direction or polarity {_FRFS}",
        link="frfs",
        remedy="Correct the direction of this FRF, or leave it out.",
    ),
    "frf_scaled": Row(
        "with_care",
        30,
        f"{{who}} another level than the rest: a wrong sensitivity or range {_FRFS}",
        link="frfs",
        remedy="Correct the sensitivity of this FRF, or leave it out.",
    ),
    "frf_unlike": Row(
        "with_care",
        30,
        f"{{who}} little agreement with the model's: a wrong point, or a damaged record {_FRFS}",
        link="frfs",
        remedy="Correct the point of this FRF, or leave it out.",
    ),
    # of the damping
    "damping_narrowed": Row(
        "with_care",
        20,
        "the damping is that of {low:.4g} to {high:.4g} Hz alone, since over the whole band {text}",
        link="update",
        remedy="Choose the band of the damping, or another law.",
    ),
    "damping_of_ratios": Row(
        "with_care",
        30,
        "the damping is that of the modes' damping ratios, not of the FRFs, since {text}",
        link="frfs",
        remedy="Find out why the FRFs disagree, or use the ratios as they are.",
    ),
    "damping_failed": Row(
        "with_care",
        50,
        "the damping could not be updated: {text}",
        link="update",
        remedy="Choose another law or band; the elastic constants stand.",
    ),
    "optima": Row(
        "with_care",
        4,
        "the fit of the {law} law has {count} optima, of which the first is reported: {points}",
        link="update",
        remedy="Fit a wider band, or another law.",
    ),
    "law_negative": Row(
        "with_care",
        3,
        "the fitted {law} law has negative damping from {first:.4g} to {last:.4g} Hz",
        "use it at the measured modes only, or choose another law",
        link="update",
    ),
    "law_replaced": Row(
        None,
        3,
        "{modes} fix the {count} coefficients of the {requested} law, so the {law} law was used",
        "measure a wider band with more modes",
        link="campaign",
    ),
    "law_inadequate": Row(
        "with_care",
        2,
        "the {law} law is inadequate for this damping{missed}{better}",
        link="damping",
        remedy="Quote its coefficients only with their intervals, or put the preferred law first.",
    ),
    "looks_windowed": Row(
        "with_care",
        1.5,
        "the response seems to have had an exponential window that is not stated: all modes share a"
        " decay of {rate:.3g} 1/s, which a window that falls to {end:.2g} % over the record of"
        " {record:.3g} s would give",
        _WINDOW,
        link="campaign",
    ),
    "window_unstated": Row(
        None,
        0.2,
        "the campaign does not say whether the response had an exponential window; a typical one"
        " would raise {name} by {percent:.0f} %, and the interval of {name} allows for that",
        _WINDOW,
        link="campaign",
    ),
    "sources_conflict": Row(
        "with_care",
        70,
        "the data contradict each other (p = {p:.2g}), and the likeliest explanation is"
        " {cause}{rivals}{cleared}",
        "correct it or leave it out",
        link="update",
    ),
    # of several campaigns
    "campaign_missed": Row(
        "with_care",
        40,
        "campaign {name}: frequencies of the joint material differ from the measured ones by"
        " {percent:.1f} % (rms)",
    ),
    "temperature_unknown": Row(
        None,
        6,
        "campaign {name} states no temperature, and the others do: it was taken to be {assumed},"
        " and comes out as {now}",
        "state its temperature_c",
        link="campaign",
    ),
    "campaign_modes_alone": Row(
        "with_care", 30, "campaign {name}: {unpaired} no partner in the model"
    ),
}
"""All that can be found, by its id."""
