"""Stored results of earlier versions, as the present one writes them. A document is changed when it is read, never in place.

| version | written by |
|---|---|
| 1 | 0.1.0: no verdict, no budget; a job without damping had no result |
| 2 | 0.2.0: one start of stage 1, no pairing, warnings without ids |
| 3 | this one, with its number as `version` |

What a version did not compute is empty or null, and a warning says so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from service.compute.identification_document import up_to_date as identification_up_to_date

Document = Mapping[str, Any]

VERSION = 3

MARKS = ("version", "outcomes")
"""Members that show the version of a document."""

_NO_VERDICT = (
    "modalbase 0.1.0, which computed this result, judged none and left the errors of dimensions, mass, support and instruments "
    "out of its intervals: they are too narrow; run the update again"
)


def up_to_date(document: Document) -> dict[str, Any]:
    """A stored document, or some of its members and its `MARKS`, as the present version writes them.

    Args:
        document: of any version; it stays as it is.
    """
    for step in _STEPS[_version(document) - 1 :]:
        document = step(document)
    return {**document, "version": VERSION}


def _version(document: Document) -> int:
    return int(document.get("version") or (2 if document.get("outcomes") else 1))


def _from_1(document: Document) -> Document:
    """0.1.0 failed a job unless both stages succeeded, and its only uncertainty was noise and the model's discrepancy."""
    return {
        **dict.fromkeys(("verdict", "warnings")),
        **document,
        "verdict": {"level": "with_care", "sentence": f"Use with care: {_NO_VERDICT}.", "reasons": []},
        "warnings": [_NO_VERDICT, *document.get("warnings", ())],
        "outcomes": [{"stage": stage, "status": "succeeded", "message": ""} for stage in ("elastic", "damping")],
        "parameters": [
            {
                **row,
                "comparable": {"estimate": row["estimate"], "standard_deviation": row["noise_standard_deviation"]},
                "budget": [],
                "confounded_with": [],
            }
            for row in document.get("parameters", ())
        ],
        "channel_delay_s": None,
    }


def _from_2(document: Document) -> Document:
    """What 0.2.0 had not from its beginning is here too: some of its first builds left results behind."""
    costs = [step["cost"] for step in document.get("convergence", ())]
    identified = document.get("identification")
    return {
        "starts": [{"chosen": True, "failure": None, "cost": costs, "parameters": {}}],
        "model_modes": [],
        "pairing": None,
        "findings": [],
        **document,
        "parameters": [{"tied_to": None, **row} for row in document.get("parameters", ())],
        "modes": [{"measured_damping_sd": None, **row} for row in document.get("modes", ())],
        "damping_models": [
            {"standard_deviations": {}, "curve": None, "by_mechanism": False, **row}
            for row in document.get("damping_models", ())
        ],
        "identification": identified and identification_up_to_date(identified),
    }


_STEPS: tuple[Callable[[Document], Document], ...] = (_from_1, _from_2)
