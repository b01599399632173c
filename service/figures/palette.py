"""Colours of things that are neither measured nor a model: distinct for people of any colour vision (Okabe and Ito)."""

PALETTE = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#8C7A00", "#777777", "#5B3A8E", "#A0522D")
