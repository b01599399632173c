"""Modes of FRFs of measured loads, with errors from the scatter of the recording's blocks.

Errors of `fecore.signal.LoadFrfs` are those of few segments, which all lines and pairs share: a
segment holds what is left of the response to earlier loads, a free decay of the same modes. Taken
line by line this looks like noise at each resonance, and hardly moves a pole; so poles are found as
where no variance is known, and their errors are what the groups of blocks move them by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fecore.errors import InputError
from fecore.modal.identify import Options, Report, identify
from fecore.modal.output_only import scatter_of_blocks, without_window
from fecore.modal.result import Identification
from fecore.signal.measured_loads import LoadFrfs


def identify_measured_loads(
    recordings: LoadFrfs | Sequence[LoadFrfs],
    options: Options | None = None,
    report: Report = lambda _stage, _share: None,
) -> Identification:
    """Natural frequencies, damping ratios and shapes from FRFs of measured loads.

    1. Identify: the FRFs of all recordings.
    2. Errors: from the scatter of the blocks.
    3. Window: its rate is taken out of the poles.

    Args:
        recordings: of one structure, one or several.
        options: as of `identify`.
        report: as of `identify`.

    Raises:
        InputError: no recording, or windows of different rates.
        IdentificationError: no mode is supported.
    """
    recordings = (recordings,) if isinstance(recordings, LoadFrfs) else tuple(recordings)
    rates = sorted({each.window_rate_per_s for each in recordings})
    if len(rates) != 1:
        raise InputError(
            "recordings",
            f"carry windows of {', '.join(f'{rate:.3g}' for rate in rates) or 'no rate'} per second,"
            " expected one of all; state `lag_s`",
        )
    # 1. Identify.
    identification = identify(
        [each.frfs(with_variance=False) for each in recordings], options, report
    )
    # 2. Errors.
    covariance = scatter_of_blocks(identification, recordings)
    # 3. Window.
    poles = without_window(identification.found.modes, covariance, rates[0])
    return replace(
        identification,
        found=replace(identification.found, modes=poles),
        window_taken_out_per_s=rates[0],
    )
