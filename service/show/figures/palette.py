"""Colours of things that are neither measured nor a model: distinct for people of any colour vision (Okabe and Ito).

The first and the sixth differ by one step from those of models, as a dark page exchanges colours by name.
"""

PALETTE = ("#0072B1", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E01", "#8C7A00", "#777777", "#5B3A8E", "#A0522D")

ON_DARK = {
    "#0072B1": "#4477DD", "#D55E01": "#E8743B", "#8C7A00": "#C8B400", "#5B3A8E": "#B39DDB", "#A0522D": "#C98A5E",
}  # fmt: skip
"""What stands for them on a dark page, where they would be too dark to see or like one another."""
