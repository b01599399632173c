"""What the child process of an identification does: FRFs in, modes and the document about them out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from fecore.frf import FrfSet
from fecore.modal import Options, identify
from fecore.modes import MeasuredModes
from service.compute.identification_document import describe_identification
from service.jobs.kinds import Report


@dataclass(frozen=True)
class IdentificationInputs:
    """FRFs by quantity and axis, in the specimen's frame, and how to identify."""

    frfs: tuple[FrfSet, ...]
    options: Options
    include_doubtful: bool
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class IdentificationOutput:
    """Modes in the specimen's frame, and the document about them."""

    modes: MeasuredModes
    document: dict[str, Any]


def find_modes(inputs: IdentificationInputs, report: Report) -> Iterator[IdentificationOutput]:
    """Identify modes and describe them."""
    found = identify(inputs.frfs, inputs.options, report)
    document = describe_identification(found)
    document["warnings"] = [*inputs.warnings, *document["warnings"]]
    yield IdentificationOutput(found.chosen(include_doubtful=inputs.include_doubtful).modes, document)
