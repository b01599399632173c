"""Time blocks of hammer hits to FRFs with variance: blocks, pulse, hit features, comparison,
judgement, windows, estimators, points, process.
"""

from fecore.signal.blocks import Block, ChannelQuantity, Hit
from fecore.signal.document import Averages, Findings, Processed, Processing
from fecore.signal.estimators import Estimate, Estimator, estimate
from fecore.signal.frf_scale import Strip
from fecore.signal.judgement import FALSE_DISCOVERY, HitVerdict
from fecore.signal.points import EachHit, Inspection, each_hit, inspect
from fecore.signal.process import Shelf, process, process_in_parts
from fecore.signal.reasons import HitFinding
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
    "Findings",
    "Hit",
    "HitFinding",
    "HitVerdict",
    "Inspection",
    "Processed",
    "Processing",
    "Shelf",
    "Source",
    "Strip",
    "Windows",
    "by_point",
    "each_hit",
    "estimate",
    "inspect",
    "process",
    "process_in_parts",
    "remove_window",
]
