"""All that a user may have to know of a result, one table: what it means for the use of the result,
the sentence, what to do about it and where.

A row has a level (None: it means nothing for the use) and a weight: within a level, more comes
first.
"""

from fecore.findings import Row
from fecore.updating.known_model_findings import CONSTANTS, MODEL, MODES

_WINDOW = "state the window's rate 1/τ with the campaign, 0 for none"
_CORRECT = "(in brackets: its factor relative to all FRFs); correct or leave out"

_FRFS = {
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
        " there: the boundary or the geometry is wrong, or modes were paired wrongly",
        link="campaign",
        advice="check boundary and geometry, and the pairs in the table of modes",
        apart=True,
    ),
    "sign_opposite": Row(
        "with_care",
        30,
        "most FRFs have the opposite sign of the model's: the hammer or the sensor has another"
        " direction or polarity than stated; the damping was fitted to the FRFs with their sign"
        " reversed",
        link="campaign",
        advice="correct the direction or polarity of hammer or sensor in the file",
        apart=True,
    ),
    "frfs_scaled": Row(
        "with_care",
        30,
        "the FRFs are {factor} times as large as the model's{unit}: check calibration (hammer,"
        " sensor, units), geometry, density, added masses and boundary; the damping was fitted to"
        " the FRFs divided by this factor",
        link="campaign",
        advice="correct what is wrong: the constants are wrong with it",
        apart=True,
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
        f"{{frfs}} {{have}} the opposite sign of the {{of}}'s: a wrong direction or polarity {_CORRECT}",
        link="frfs",
        advice="correct the direction of this FRF, or leave it out",
        apart=True,
        subject="{frfs}",
    ),
    "frf_scaled": Row(
        "with_care",
        30,
        f"{{frfs}} {{have}} another level than the rest: a wrong sensitivity or range {_CORRECT}",
        link="frfs",
        advice="correct the sensitivity of this FRF, or leave it out",
        apart=True,
        subject="{frfs}",
    ),
    "frf_unlike": Row(
        "with_care",
        30,
        f"{{frfs}} {{have}} little agreement with the model's: a wrong point, or a damaged record {_CORRECT}",
        link="frfs",
        advice="correct the point of this FRF, or leave it out",
        apart=True,
        subject="{frfs}",
    ),
}
_DAMPING = {
    "damping_narrowed": Row(
        "with_care",
        20,
        "the damping is that of {low:.4g} to {high:.4g} Hz alone, since over the whole band {text}",
        link="update",
        advice="choose the band of the damping, or another law",
        apart=True,
    ),
    "damping_of_ratios": Row(
        "with_care",
        30,
        "the damping is that of the modes' damping ratios, not of the FRFs, since {text}",
        link="frfs",
        advice="find out why the FRFs disagree, or use the ratios as they are",
        apart=True,
    ),
    "damping_failed": Row(
        "with_care",
        50,
        "the damping could not be updated: {text}",
        link="update",
        advice="choose another law or band; the elastic constants stand",
        apart=True,
    ),
    "optima": Row(
        "with_care",
        4,
        "the fit of the {law} law has {count} optima, of which the first is reported: {points}",
        link="update",
        advice="fit a wider band, or another law",
        apart=True,
        subject="the {law} law",
    ),
    "law_negative": Row(
        "with_care",
        3,
        "the fitted {law} law has negative damping from {first:.4g} to {last:.4g} Hz",
        "use it at the measured modes only, or choose another law",
        link="update",
        subject="the {law} law",
        folds=False,
    ),
    "law_replaced": Row(
        None,
        3,
        "{modes} fix the {count} coefficients of the {requested} law, so the {law} law was used",
        "measure a wider band with more modes",
        link="campaign",
        subject="the {law} law",
    ),
    "law_inadequate": Row(
        "with_care",
        2,
        "the {law} law is inadequate for this damping{missed}{better}",
        link="damping",
        advice="quote its coefficients only with their intervals, or put the preferred law first",
        apart=True,
        subject="the {law} law",
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
        subject="{source}",
        folds=False,
    ),
}
_CAMPAIGNS = {
    "campaign_missed": Row(
        "with_care",
        40,
        "campaign {name}: frequencies of the joint material differ from the measured ones by"
        " {percent:.1f} % (rms)",
        subject="campaign {name}",
    ),
    "temperature_unknown": Row(
        None,
        6,
        "campaign {name} states no temperature, and the others do: it was taken to be {assumed},"
        " and comes out as {now}",
        "state its temperature_c",
        link="campaign",
        subject="campaign {name}",
    ),
    "campaign_modes_alone": Row(
        "with_care",
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
