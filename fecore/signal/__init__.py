"""Time blocks of hammer hits to FRFs with variance: blocks, pulse, traits, comparison, judgement,
windows, estimators, points, process.
"""

from fecore.signal.blocks import Block, ChannelQuantity, Hit
from fecore.signal.document import Averages, Findings, Processed, Processing
from fecore.signal.estimators import Estimate, Estimator, estimate
from fecore.signal.heights import Strip
from fecore.signal.judgement import FALSE_DISCOVERY, Verdict
from fecore.signal.points import EachHit, Inspection, each_hit, inspect
from fecore.signal.process import Shelf, process, process_in_parts
from fecore.signal.reasons import Finding
from fecore.signal.spectra import Source, by_point
from fecore.signal.windows import Windows, remove_window

__all__ = [
    "FALSE_DISCOVERY",
    "Averages",
    "Block",
    "ChannelQuantity",
    "EachHit",
    "Estimate",
    "Estimator",
    "Finding",
    "Findings",
    "Hit",
    "Inspection",
    "Processed",
    "Processing",
    "Shelf",
    "Source",
    "Strip",
    "Verdict",
    "Windows",
    "by_point",
    "each_hit",
    "estimate",
    "inspect",
    "process",
    "process_in_parts",
    "remove_window",
]
