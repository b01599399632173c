"""All that a user may have to know of a result, one table: what it means for the use of the result,
the sentence, what to do about it and where.

A row has a level (None: it means nothing for the use) and a weight: within a level, more comes
first.
"""

from functools import partial

from fecore.findings import Row

_stop, _care = partial(Row, "do_not_use"), partial(Row, "with_care")
_note = partial(Row, None)  # it means nothing for the use
_ANOTHER_BODY = "check that the file belongs to this structure, and boundary, points and frame"
_DECIDE = "shapes measured at more points would decide"

MODEL = {
    "mesh_misses": _care(
        8,
        "the finest mesh allowed, {nx} × {ny} elements, may give frequencies that are wrong by"
        " {percent:.2g} %",
        "choose a band that ends lower",
        link="update",
    ),
    "mesh_moves": _note(
        7,
        "on the model's own mesh, of elements of {size:.2g} mm, the result would move: {moved}; the"
        " constants are those of elements of {finest:.2g} mm",
        "elements of {enough:.2g} mm would do",
        link="structure",
    ),
    "mesh_decides": _care(
        20,
        "the mesh decides {names}, whatever was measured",
        "make its elements smaller, and its facets as many as the curve needs",
        link="structure",
    ),
    "mesh_on_trust": _note(
        1,
        "what the model's mesh misses is not known, as {why}: it is taken on trust, and is in no"
        " interval",
        link="structure",
        advice="compare its frequencies with those of a finer mesh in the program that it is of",
        apart=True,
    ),
    "without_joints": _note(
        4,
        "walls of the model meet at their middle surfaces without a model of their joint, as the"
        " recipe has it: each frequency may be wrong by {percent:.2g} %",
        "constants found so belong to models without joints",
    ),
    "points_beyond": _care(
        9,
        "{where}points {points} lie beyond the {name} of {size:g} mm, by up to {out:.2g} mm",
        "the {name} or the points' coordinates are wrong, and so may be the constants; correct what"
        " is wrong",
        link="structure",
        subject="{campaign}",
        folds=False,
    ),
    "joint_needs_frfs": _care(
        1,
        "the method joint needs FRFs, and the campaign has none: the constants were estimated from"
        " the modes, as the method two_stage does",
        link="campaign",
        advice="import the FRFs for a joint update",
        apart=True,
    ),
    "loads_unmeasured": _note(
        6,
        "the modes are of responses to loads that nobody measured, so their shapes are"
        " unscaled{without}",
        folds=False,
    ),
    "roving_sensor": _care(
        1,
        "the sensor of {grams:.3g} g moved with the response, so its mass shifts the modes from FRF"
        " to FRF: the constants, and the modes without the sensor, were estimated from the FRFs"
        " with a model that carries it, as the method joint does{unused}",
        link="campaign",
        advice="state the sensor's grid point if it stood still",
        apart=True,
    ),
}
"""Of the model and its mesh."""

MODES = {
    "no_like_mode": _stop(
        110,
        "no measured mode shape agrees with one of the model (largest MAC {mac:.2f}): the model is"
        " not one of the structure that was measured",
        _ANOTHER_BODY + ". The modes that agree best are paired for comparison only",
        link="campaign",
    ),
    "halves_of_a_mode": _care(
        105,
        "measured modes {which} lie closer together than their bandwidths, and the model has only"
        " one mode there: probably one mode, of a structure that changed between the FRFs"
        " (temperature, supports, a sensor that was moved)",
        "measure faster or at a constant temperature, or leave one of the two out of the mode set",
        link="modes",
        subject="measured modes {which}",
    ),
    "two_in_one": _note(
        3,
        "measured mode {which} is probably two: the model has modes at {hz}, closer together than"
        " half a bandwidth, which the FRFs do not separate. Its frequency is of both, its shape and"
        " damping are a mixture",
        "hit or sense at a second place, where one of the two stands still",
        link="modes",
        subject="measured mode {which}",
    ),
    "most_modes_alone": _stop(
        100,
        "{unpaired} no partner in the model: the model is not one of the structure that was measured",
        _ANOTHER_BODY,
        link="campaign",
    ),
    "modes_alone": _care(
        6,
        "{unpaired} no partner in the model",
        link="modes",
        advice="leave in-plane modes out of the mode set, and check boundary, frame and geometry",
        apart=True,
    ),
    "mode_not_believed": _note(
        2,
        "measured mode {which}, which is a mode with probability {probability:.2f}, lies {off:+.2f}"
        " % off its partner in the model and is left out",
        "look at it in the FRFs, and drop or keep it in the mode set",
        link="modes",
        subject="measured mode {which}",
    ),
    "shapes_unlike": _stop(
        80,
        "most measured mode shapes disagree with the model's (median MAC {mac:.2f})",
        link="campaign",
        advice="check boundary, geometry, frame and numbering of the points",
        apart=True,
    ),
    "shape_unlike": _care(
        7,
        "measured mode {which} agrees poorly with its partner, model mode {model} ({hz:.2f} Hz):"
        " MAC {mac:.2f}",
        "check boundary, points and directions; use_shapes lets shapes choose too",
        link="campaign",
        subject="measured mode {which}",
    ),
    "rival_pairing": _care(
        40,
        "the measured modes may be paired with the wrong modes of the model: another pairing, which"
        " gives {other}, is nearly as likely (its log evidence is lower by"
        " {evidence:.1f}){spanned}",
        _DECIDE,
        link="campaign",
    ),
    "rival_constants": _care(
        40,
        "the frequencies are nearly the same with other constants: {other} are nearly as likely"
        " (their log evidence is lower by {evidence:.1f}){spanned}",
        _DECIDE,
        link="campaign",
    ),
    "partners_swing": _care(
        30,
        "the partner of measured mode {which} alternated during the fit, because modes of the model"
        " cross there: each pairing was fitted separately, and the most likely one is reported",
        _DECIDE,
        link="campaign",
        subject="measured mode {which}",
    ),
}
"""Of the modes and their partners."""

CONSTANTS = {
    "frequencies_missed": _care(
        60,
        "the frequencies of the updated model differ from the measured ones by {percent:.1f} %"
        " (rms), far more than the error of plate theory: a prior is too narrow, a constant fixed"
        " at a wrong value, or geometry, density or boundary wrong",
        "find the cause before you use the estimates",
        link="structure",
    ),
    "stiffness_changed": _note(
        4,
        "with a probability of {p:.2g} the stiffness has changed between x = {begin:.3g} and"
        " {end:.3g} mm, over {least:.3g} to {most:.3g} mm of that: the modes do not resolve it"
        " further, so the factor of a zone is the mean over the zone",
        "more modes would narrow it",
        link="campaign",
    ),
    "confounded": _note(
        3,
        "{name} cannot be distinguished from {others}: the data determine only a combination of"
        " them",
        "fix one of them, or state how well it is known",
        link="update",
        subject="{name}",
        folds=False,
    ),
    "not_determined": _care(
        10,
        "the recipe asks for {names}, which the data do not determine: what is given is the prior",
        "leave out what you do not need, measure a wider band, or state a better prior",
        link="update",
    ),
    "nothing_determined": _care(
        10,
        "the data determine none of the constants: what is given is the prior",
        "measure a wider band, or at more points",
        link="update",
    ),
    "samples_differ": _care(
        5,
        "the sampled posterior of {name} is {ratio:.2f} times as wide as its Laplace approximation",
        "use the samples",
        link="update",
        subject="{name}",
    ),
    "length_moves": _note(
        1.2,
        "the modes show the length to ± {rest:.2g} % alone: a length 1 % longer than stated would"
        " change {moved}",
        "measure it twice",
        link="structure",
    ),
    "support_moves": _note(
        1.1,
        "the support may give way {stiffness} for all that the modes say: that would change"
        " {moved}",
        link="campaign",
        advice="measure shapes at points near the support, or how firm it is; or hold it more firmly",
        apart=True,
    ),
}
"""Of the constants."""

_WINDOW = "state the window's rate 1/τ with the campaign, 0 for none"
_CORRECT = "(in brackets: its factor relative to all FRFs); correct or leave out"

_FRFS = {
    "frfs_unlike": _stop(
        90,
        "most FRFs disagree with the model's (median agreement {likeness:.2f}, 1 would be perfect):"
        " a wrong boundary, geometry, frame or numbering of the points",
        "find the cause before you use the estimates",
        link="campaign",
    ),
    "modes_absent": _care(
        85,
        "the model has {modes} at {which} that the FRFs should show clearly, and they show none"
        " there: the boundary or the geometry is wrong, or modes were paired wrongly",
        link="campaign",
        advice="check boundary and geometry, and the pairs in the table of modes",
        apart=True,
    ),
    "sign_opposite": _care(
        30,
        "most FRFs have the opposite sign of the model's: the hammer or the sensor has another"
        " direction or polarity than stated; the damping was fitted to the FRFs with their sign"
        " reversed",
        link="campaign",
        advice="correct the direction or polarity of hammer or sensor in the file",
        apart=True,
    ),
    "frfs_scaled": _care(
        30,
        "the FRFs are {factor} times as large as the model's{unit}: check calibration (hammer,"
        " sensor, units), geometry, density, added masses and boundary; the damping was fitted to"
        " the FRFs divided by this factor",
        link="campaign",
        advice="correct what is wrong: the constants are wrong with it",
        apart=True,
    ),
    "frfs_scaled_by_place": _note(
        3,
        "the FRFs are {factor} times as large as the model's{unit}: the sensor, or the hammer, that"
        " stood still is some millimetres off its point, near which the modes are steep, or its"
        " calibration is wrong",
        "measure where it is; the damping was fitted to the FRFs divided by this factor",
        link="campaign",
    ),
    "frf_turned": _care(
        30,
        f"{{frfs}} {{have}} the opposite sign of the {{of}}'s: a wrong direction or polarity {_CORRECT}",
        link="frfs",
        advice="correct the direction of this FRF, or leave it out",
        apart=True,
        subject="{frfs}",
    ),
    "frf_scaled": _care(
        30,
        f"{{frfs}} {{have}} another level than the rest: a wrong sensitivity or range {_CORRECT}",
        link="frfs",
        advice="correct the sensitivity of this FRF, or leave it out",
        apart=True,
        subject="{frfs}",
    ),
    "frf_unlike": _care(
        30,
        f"{{frfs}} {{have}} little agreement with the model's: a wrong point, or a damaged record {_CORRECT}",
        link="frfs",
        advice="correct the point of this FRF, or leave it out",
        apart=True,
        subject="{frfs}",
    ),
}

_DAMPING = {
    "damping_narrowed": _care(
        20,
        "the damping is that of {low:.4g} to {high:.4g} Hz alone, since over the whole band {text}",
        link="update",
        advice="choose the band of the damping, or another law",
        apart=True,
    ),
    "damping_of_ratios": _care(
        30,
        "the damping is that of the modes' damping ratios, not of the FRFs, since {text}",
        link="frfs",
        advice="find out why the FRFs disagree, or use the ratios as they are",
        apart=True,
    ),
    "damping_failed": _care(
        50,
        "the damping could not be updated: {text}",
        link="update",
        advice="choose another law or band; the elastic constants stand",
        apart=True,
    ),
    "optima": _care(
        4,
        "the fit of the {law} law has {count} optima, of which the first is reported: {points}",
        link="update",
        advice="fit a wider band, or another law",
        apart=True,
        subject="the {law} law",
    ),
    "law_negative": _care(
        3,
        "the fitted {law} law has negative damping from {first:.4g} to {last:.4g} Hz",
        "use it at the measured modes only, or choose another law",
        link="update",
        subject="the {law} law",
        folds=False,
    ),
    "law_replaced": _note(
        3,
        "{modes} fix the {count} coefficients of the {requested} law, so the {law} law was used",
        "measure a wider band with more modes",
        link="campaign",
        subject="the {law} law",
    ),
    "law_inadequate": _care(
        2,
        "the {law} law is inadequate for this damping{missed}{better}",
        link="damping",
        advice="quote its coefficients only with their intervals, or put the preferred law first",
        apart=True,
        subject="the {law} law",
    ),
    "looks_windowed": _care(
        1.5,
        "the response seems to have had an exponential window that is not stated: all modes share a"
        " decay of {rate:.3g} 1/s, which a window that falls to {end:.2g} % over the record of"
        " {record:.3g} s would give",
        _WINDOW,
        link="campaign",
    ),
    "window_unstated": _note(
        0.2,
        "the campaign does not say whether the response had an exponential window; a typical one"
        " would raise {name} by {percent:.0f} %, and the interval of {name} allows for that",
        _WINDOW,
        link="campaign",
    ),
    "sources_conflict": _care(
        70,
        "the data contradict each other (p = {p:.2g}), and the likeliest explanation is"
        " {cause}{rivals}{cleared}",
        "correct it or leave it out",
        link="update",
        subject="{source}",
        folds=False,
    ),
}

_CAMPAIGNS = {
    "campaign_missed": _care(
        40,
        "campaign {name}: frequencies of the joint material differ from the measured ones by"
        " {percent:.1f} % (rms)",
        subject="campaign {name}",
    ),
    "temperature_unknown": _note(
        6,
        "campaign {name} states no temperature, and the others do: it was taken to be {assumed},"
        " and comes out as {now}",
        "state its temperature_c",
        link="campaign",
        subject="campaign {name}",
    ),
    "campaign_modes_alone": _care(
        30,
        "campaign {name}: {unpaired} no partner in the model",
        subject="campaign {name}",
    ),
}

SECTIONS = {
    "The model and its mesh": MODEL,
    "The modes and their partners": MODES,
    "The constants": CONSTANTS,
    "FRFs beside those of the model": _FRFS,
    "The damping": _DAMPING,
    "Several campaigns": _CAMPAIGNS,
}
"""The rows by what they are about."""

FINDINGS = {kind: row for rows in SECTIONS.values() for kind, row in rows.items()}
"""All that can be found of a result, by its id."""

SECTION_OF = {kind: title for title, rows in SECTIONS.items() for kind in rows}
"""The title of the guide's section that lists a finding, by its id."""

PASSED_ON = {"measurement": 0.5, "pairing": 1.0}
"""Kinds under which a result passes on remarks on the data and on the modes' partners, with their
weights.
"""
