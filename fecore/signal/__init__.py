"""Time blocks of hammer hits to FRFs with variance, and responses alone to half spectra, in the
order of the data.

blocks, recording               hits as time blocks; a long recording, cut into them
pulse, windows, unstated        the force's pulse; windows that are stated, and one that is not
spectra, estimators             blocks to spectra; spectra to FRFs with variance
hit_features                    what each hit's own blocks show
participation, slopes,
hit_location                    its participation in each resonance, and by it where it landed
comparison                      each hit beside the others of its point
delay, coupling                 a delay between channels; the tail of an AC coupled one
weights, judgement              how probably each hit is good, calibrated
findings, reasons               what is said of hits
frf_scale                       whether FRFs fit the mass and stiffness of a strip
points                          hits as a person beside the hammer sees them
document                        what a processing is asked, and what it answers
process                         all of it, point by point
block_spectra                   spectra of a recording with their scatter over its blocks
measured_loads, steady_loads    any measured load, to FRFs; sines, and loads that repeat
stepped_sines                   FRFs of several recordings with such loads, joined
half_spectra, setups            responses to loads that nobody measured; several such recordings
transmissibility                such responses for each unit of some of them
"""

from fecore.signal.blocks import Block, ChannelQuantity, Hit
from fecore.signal.document import Averages, Findings, Processed, Processing
from fecore.signal.estimators import Estimate, Estimator, estimate
from fecore.signal.frf_scale import Strip
from fecore.signal.half_spectra import HalfSpectra, half_spectra
from fecore.signal.judgement import FALSE_DISCOVERY, HitVerdict
from fecore.signal.measured_loads import LoadFrfs, frfs_of_loads
from fecore.signal.points import EachHit, Inspection, each_hit, inspect
from fecore.signal.process import Shelf, process, process_in_parts
from fecore.signal.reasons import HitFinding
from fecore.signal.setups import ResponseRecording, spectra_of_setups
from fecore.signal.spectra import Source, by_point
from fecore.signal.stepped_sines import with_steps_joined
from fecore.signal.transmissibility import Transmissibilities, transmissibilities
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
    "HalfSpectra",
    "Hit",
    "HitFinding",
    "HitVerdict",
    "Inspection",
    "LoadFrfs",
    "Processed",
    "Processing",
    "ResponseRecording",
    "Shelf",
    "Source",
    "Strip",
    "Transmissibilities",
    "Windows",
    "by_point",
    "each_hit",
    "estimate",
    "frfs_of_loads",
    "half_spectra",
    "inspect",
    "process",
    "process_in_parts",
    "remove_window",
    "spectra_of_setups",
    "transmissibilities",
    "with_steps_joined",
]
