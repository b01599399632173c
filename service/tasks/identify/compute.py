"""What the child process of an identification does: FRFs or half spectra in, modes and the document
about them out.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from fecore.frf import FrfSet
from fecore.modal import Options, identify, identify_measured_loads, identify_output_only
from fecore.modes import MeasuredModes
from fecore.signal import HalfSpectra, LoadFrfs
from service.compute.identifying import describe_identification
from service.platform.queue.kinds import Reporter


@dataclass(frozen=True)
class IdentificationInputs:
    """FRFs by quantity and axis, or half spectra, in the specimen's frame; and how to identify."""

    frfs: tuple[FrfSet, ...]
    spectra: tuple[HalfSpectra, ...]  # of each recording of responses; none beside FRFs
    loads: tuple[LoadFrfs, ...]  # of each recording with loads, where all FRFs are of these
    options: Options
    include_doubtful: bool
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class IdentificationOutput:
    """Modes in the specimen's frame, and the document about them."""

    modes: MeasuredModes
    document: dict[str, Any]


def find_modes(inputs: IdentificationInputs, report: Reporter) -> Iterator[IdentificationOutput]:
    """Identify modes and describe them."""
    if inputs.spectra:
        identification = identify_output_only(inputs.spectra, inputs.options, report).identification
    elif inputs.loads:
        identification = identify_measured_loads(inputs.loads, inputs.options, report)
    else:
        identification = identify(inputs.frfs, inputs.options, report)
    document = describe_identification(identification)
    document["warnings"] = [*inputs.warnings, *document["warnings"]]
    yield IdentificationOutput(
        identification.chosen(include_doubtful=inputs.include_doubtful).modes, document
    )
