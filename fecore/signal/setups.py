"""Several recordings of responses, which are joined by references: half spectra of each."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fecore.errors import InputError
from fecore.frf import Dof
from fecore.signal.block_spectra import DERIVATIVE, Chunks, Motion
from fecore.signal.half_spectra import HalfSpectra, half_spectra, longest_lag_s

_MOST_COMMON = 4  # references in common that are all taken


@dataclass(frozen=True)
class ResponseRecording:
    """A recording of responses to loads that nobody measured."""

    chunks: Chunks  # gives its (N, n) parts in order, as often as it is called
    sample_rate_hz: float
    samples: int  # of each channel
    responses: tuple[Dof, ...]  # N
    quantities: tuple[Motion, ...]  # N, what each channel measures
    name: str = ""  # in messages


def spectra_of_setups(
    setups: Sequence[ResponseRecording],
    references: Sequence[Dof] | None = None,
    lag_s: float | None = None,
) -> Iterator[HalfSpectra]:
    """Half spectra of each recording, with one longest lag and references in common.

    1. Lag: the longest of the shortest recording.
    2. References: sensors that stayed; of many, those that show most in the first recording.
    3. Spectra: of each recording.

    Args:
        setups: recordings of one structure, one or several.
        references: those that the others are correlated with; chosen where not stated.
        lag_s: longest lag; chosen where not stated.

    Raises:
        InputError: sampling rates differ, nothing stayed from setup to setup, or as of
            `half_spectra`.
    """
    # 1. Lag.
    rates = sorted({setup.sample_rate_hz for setup in setups})
    if len(rates) > 1:
        raise InputError(
            "recordings",
            f"have {' and '.join(f'{rate:g}' for rate in rates)} samples a second, expected one"
            " rate of all; put those of each rate into a campaign of their own",
        )
    if lag_s is None:
        lag_s = min(longest_lag_s(setup.samples, setup.sample_rate_hz) for setup in setups)
    # 2. References.
    among: Sequence[Dof] | None = None
    if references is None and len(setups) > 1:
        among = _in_common(setups)
        references = among if len(among) <= _MOST_COMMON else None
    # 3. Spectra.
    for setup in setups:
        own = references and [dof for dof in references if dof in setup.responses]
        if references and not own:
            raise InputError(
                "references", f"{', '.join(map(_named, references))} are not in {setup.name}"
            )
        spectra = half_spectra(
            setup.chunks,
            setup.sample_rate_hz,
            setup.responses,
            references=own,
            lag_s=lag_s,
            quantities=setup.quantities,
            among=among,
        )
        references = references or spectra.references
        yield spectra


def _in_common(setups: Sequence[ResponseRecording]) -> list[Dof]:
    """Sensors that all recordings have, or else those that any two have; of the highest derivative
    in each.
    """
    counts = Counter(dof for setup in setups for dof in _highest(setup))
    for least in (len(setups), 2):
        if common := [dof for dof, count in counts.items() if count >= least]:
            return common
    raise InputError(
        "references",
        f"no sensor is in two of the {len(setups)} recordings, so that their shapes cannot be"
        " joined; put recordings of other sensors into a campaign of their own, or leave a sensor"
        " where it is",
    )


def _highest(setup: ResponseRecording) -> list[Dof]:
    order = [DERIVATIVE[each] for each in setup.quantities]
    return [dof for dof, own in zip(setup.responses, order, strict=True) if own == max(order)]


def _named(dof: Dof) -> str:
    return f"point {dof.point} along {dof.direction}"
