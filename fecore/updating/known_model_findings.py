"""What may have to be known of the model, of the modes and of the constants: rows of
`known_findings`.
"""

from fecore.findings import Row

_ANOTHER_BODY = "check that the file belongs to this structure, and boundary, points and frame"
_DECIDE = "shapes measured at more points would decide"

MODEL = {
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
        advice="compare its frequencies with those of a finer mesh in the program that it is of",
        apart=True,
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
        subject="{campaign}",
        folds=False,
    ),
    "joint_needs_frfs": Row(
        "with_care",
        1,
        "the method joint needs FRFs, and the campaign has none: the constants were estimated from"
        " the modes, as the method two_stage does",
        link="campaign",
        advice="import the FRFs for a joint update",
        apart=True,
    ),
    "roving_sensor": Row(
        "with_care",
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
        subject="measured modes {which}",
    ),
    "two_in_one": Row(
        None,
        3,
        "measured mode {which} is probably two: the model has modes at {hz}, closer together than"
        " half a bandwidth, which the FRFs do not separate. Its frequency is of both, its shape and"
        " damping are a mixture",
        "hit or sense at a second place, where one of the two stands still",
        link="modes",
        subject="measured mode {which}",
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
        advice="leave in-plane modes out of the mode set, and check boundary, frame and geometry",
        apart=True,
    ),
    "mode_not_believed": Row(
        None,
        2,
        "measured mode {which}, which is a mode with probability {probability:.2f}, lies {off:+.2f}"
        " % off its partner in the model and is left out",
        "look at it in the FRFs, and drop or keep it in the mode set",
        link="modes",
        subject="measured mode {which}",
    ),
    "shapes_unlike": Row(
        "do_not_use",
        80,
        "most measured mode shapes disagree with the model's (median MAC {mac:.2f})",
        link="campaign",
        advice="check boundary, geometry, frame and numbering of the points",
        apart=True,
    ),
    "shape_unlike": Row(
        "with_care",
        7,
        "measured mode {which} agrees poorly with its partner, model mode {model} ({hz:.2f} Hz):"
        " MAC {mac:.2f}",
        "check boundary, points and directions",
        link="campaign",
        subject="measured mode {which}",
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
        subject="measured mode {which}",
    ),
}
"""Of the modes and their partners."""

CONSTANTS = {
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
        subject="{name}",
        folds=False,
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
        subject="{name}",
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
        advice="measure shapes at points near the support, or how firm it is; or hold it more firmly",
        apart=True,
    ),
}
"""Of the constants."""
