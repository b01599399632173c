"""Time blocks of hammer hits to FRFs with variance: blocks, pulse, traits, comparison, judgement, heights, windows,
estimators, process.
"""

from fecore.processing.blocks import Block, ChannelQuantity, Hit
from fecore.processing.coupling import Coupling
from fecore.processing.delay import Delay, estimate_delay
from fecore.processing.document import Averages, Findings, Processed, Processing
from fecore.processing.each_hit import EachHit, each_hit
from fecore.processing.estimators import Estimate, Estimator, estimate
from fecore.processing.heights import Strip
from fecore.processing.judgement import Criterion, Finding, Limits, Verdict, overrule
from fecore.processing.look import Look, look
from fecore.processing.process import Shelf, process, process_in_parts
from fecore.processing.spectra import Source, by_point
from fecore.processing.windows import Windows, remove_window

__all__ = [
    "Averages",
    "Block",
    "ChannelQuantity",
    "Coupling",
    "Criterion",
    "Delay",
    "EachHit",
    "Estimate",
    "Estimator",
    "Finding",
    "Findings",
    "Hit",
    "Limits",
    "Look",
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
    "estimate_delay",
    "look",
    "overrule",
    "process",
    "process_in_parts",
    "remove_window",
]
