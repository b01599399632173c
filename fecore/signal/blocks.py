"""Time blocks of a hammer test: one channel's block, and the hit that several channels recorded
together.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal, get_args

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.frf import Dof, Quantity

ChannelQuantity = Literal["force", "acceleration", "velocity", "displacement"]

FRF_QUANTITY: dict[ChannelQuantity, Quantity] = {
    "acceleration": "accelerance",
    "velocity": "mobility",
    "displacement": "receptance",
}

FEWEST_SAMPLES = 64
"""Samples below which a block holds neither a pulse with its surroundings nor a spectrum."""

MEAN_TO_SD = float(np.sqrt(np.pi) / 2)
"""Of the mean step between two white samples, to the standard deviation of one."""

_WEAKEST = 0.03  # of an analyser's window, that is undone: below it there is noise alone
_PART = 64  # samples, of which the quietest in the block's first quarter show its noise


def smallest_step(x: FloatArray) -> float:
    """The converter's step: the smallest gap between values."""
    gaps = np.diff(np.sort(x))
    gaps = gaps[gaps > 1e-6 * np.abs(x).max()]
    return float(gaps.min()) if gaps.size else 0.0


@lru_cache(maxsize=16)
def exponential(samples: int, rate_per_sample: float) -> FloatArray:
    """(n,) exp(-rate i) of the samples i."""
    weights: FloatArray = np.exp(-rate_per_sample * np.arange(samples))
    weights.flags.writeable = False
    return weights


def finite(samples: FloatArray) -> bool:
    """Whether all samples are finite numbers whose sum does not overflow: one pass, in their own
    precision where it will do.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(samples.sum()) or np.isfinite(samples.sum(dtype=np.float64)))


@dataclass(frozen=True)
class Block:
    """What one channel recorded of one hit.

    Attributes:
        dof: grid point and signed direction of the sensor or the hit.
        quantity: what the samples are.
        samples: (n,) values in SI (N, m/s², m/s, m), after the sensitivity.
        window_rate_per_s: r where the analyser has multiplied the block by exp(-r t), t from its
            first sample; 0 for
        none.
        full_scale: largest magnitude that the channel can record, in the unit of the samples; None
            where it is not
        known.
    """

    dof: Dof
    quantity: ChannelQuantity
    samples: FloatArray
    window_rate_per_s: float = 0.0
    full_scale: float | None = None

    def __post_init__(self) -> None:
        if self.quantity not in get_args(ChannelQuantity):
            raise InputError(
                "quantity",
                f"is {self.quantity!r}, expected one of {', '.join(get_args(ChannelQuantity))}",
            )
        if self.samples.ndim != 1 or self.samples.size < FEWEST_SAMPLES:
            raise InputError(
                "samples",
                f"has shape {self.samples.shape}, expected {FEWEST_SAMPLES} samples or more",
            )
        if not finite(self.samples):
            bad = np.flatnonzero(~np.isfinite(self.samples))
            where = (
                f"NaN or infinity, first at sample {bad[0] + 1}"
                if bad.size
                else "numbers whose sum overflows"
            )
            raise InputError("samples", f"of the {self.quantity} hold {where}")
        if not (np.isfinite(self.window_rate_per_s) and self.window_rate_per_s >= 0):
            raise InputError(
                "window_rate_per_s", f"is {self.window_rate_per_s}, expected 0 or more per second"
            )
        if self.full_scale is not None and not self.full_scale > 0:
            raise InputError("full_scale", f"is {self.full_scale}, expected a positive number")

    def window(self, sample_rate_hz: float) -> FloatArray | None:
        """(n,) weights that the analyser has applied, or None for none."""
        if self.window_rate_per_s == 0:
            return None
        return exponential(self.samples.size, self.window_rate_per_s / sample_rate_hz)

    @cached_property
    def weakest(self) -> float:
        """The analyser's window where it leaves noise alone, or the converter's steps, as they are
        where the window came before the converter: white noise is half a step there.
        """
        quarter = self.samples[: self.samples.size // 4].astype(float)
        parts = np.abs(np.diff(quarter))[: (quarter.size - 1) // _PART * _PART].reshape(-1, _PART)
        noise = float(parts.mean(axis=1).min()) * MEAN_TO_SD if len(parts) else 0.0
        return float(np.clip(smallest_step(self.samples) / max(2 * noise, 1e-300), _WEAKEST, 1.0))

    def shown(self, sample_rate_hz: float) -> int:
        """Samples from the first on that the analyser's window leaves more of; the first quarter at
        least.
        """
        rate, size = self.window_rate_per_s / sample_rate_hz, self.samples.size
        return (
            size
            if rate == 0
            else min(max(int(np.log(1 / self.weakest) / rate) + 1, size // 4), size)
        )

    def undone(self, sample_rate_hz: float) -> FloatArray:
        """(n,) samples as they were before the analyser's window, up to there."""
        window = self.window(sample_rate_hz)
        return np.asarray(
            self.samples if window is None else self.samples / np.maximum(window, self.weakest),
            dtype=float,
        )


@dataclass(frozen=True)
class Hit:
    """One hit: the force and what the sensors recorded of it, on one clock.

    Attributes:
        force: the hammer's block.
        responses: the sensors' blocks, as long as the force.
        sample_rate_hz: samples a second.
        number: which hit of its point it is, from 1.
    """

    force: Block
    responses: tuple[Block, ...]
    sample_rate_hz: float
    number: int = 1

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sample_rate_hz) and self.sample_rate_hz > 0):
            raise InputError(
                "sample_rate_hz", f"is {self.sample_rate_hz}, expected a positive number"
            )
        if self.force.quantity != "force":
            raise InputError(
                "force",
                f"holds {self.force.quantity}; the channels are swapped, or their names are",
            )
        if not self.responses:
            raise InputError("responses", "is empty; a hit needs a response")
        for block in self.responses:
            if block.quantity == "force":
                raise InputError("responses", "holds a force; a hit has one hammer")
            if block.samples.size != self.force.samples.size:
                raise InputError(
                    "responses",
                    f"has {block.samples.size} samples at point {block.dof.point}, the force "
                    f"{self.force.samples.size}; "
                    "both channels of a hit are as long",
                )

    @property
    def samples(self) -> int:
        """Length of the blocks."""
        return int(self.force.samples.size)

    @property
    def pair(self) -> tuple[Dof, tuple[Dof, ...]]:
        """Where it was hit and where the sensors stood: hits with the same pair are averaged."""
        return self.force.dof, tuple(block.dof for block in self.responses)
