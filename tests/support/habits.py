"""What instruments and hands do beyond `hammer`: tips of other stiffness, drift, hum, offsets,
short leads, hits that soon follow one another. None of it makes a hit a bad one, but for an
amplifier that saturates.
"""

from dataclasses import replace

import numpy as np

from fecore.arrays import FloatArray
from tests.support.hammer import PLACE_SD_M, Bench, Body, Laboratory, Pulse, Simulated

HABITS = (
    *(
        "as simulated",
        "hard tip",
        "soft tip",
        "half-band filter",
        "short pretrigger",
        "soft tip, short pretrigger",
    ),
    *(
        "offset",
        "drift",
        "hum",
        "hum, short pretrigger",
        "swinging cords",
        "hits soon after one another",
    ),
    *(
        "hammer rings",
        "hits of 1 to 6",
        "16 steps of noise",
        "frequencies wander",
        "hand steadier at some points",
    ),
    "amplifier saturates",
)
_SATURATED = 0.25  # of the hits, where the amplifier saturates


class HabitBench(Bench):
    """A bench whose instruments or whose hand have one habit."""

    def __init__(
        self,
        body: Body,
        laboratory: Laboratory,
        sensor: tuple[float, float],
        rng: np.random.Generator,
        habit: str,
    ) -> None:
        self.habit, self.saturates = "", False
        super().__init__(body, instruments(laboratory, habit, rng), sensor, rng)
        self.habit = habit
        self.faults = [
            fault for fault in self.faults if not ("pretrigger" in habit and fault == "late")
        ]

    def hit(
        self, label: int, place: tuple[float, float], number: int, fault: str | None = None
    ) -> Simulated:
        """One hit, whose fault may be `saturated`, too; a hand that is steadier at some points
        lands 1 to 4 mm beside them, by point.
        """
        self.saturates = fault == "saturated" or (
            self.habit == "amplifier saturates" and fault is None and self.rng.random() < _SATURATED
        )
        if self.habit == "hand steadier at some points" and fault != "off_place":
            more = np.sqrt(np.random.default_rng(label).uniform(0, 4)) * PLACE_SD_M * 0.9
            place = (
                place[0] + more * self.rng.standard_normal(),
                place[1] + more * self.rng.standard_normal(),
            )
        found = super().hit(label, place, number, None if self.saturates else fault)
        return replace(found, fault="saturated") if self.saturates else found

    def _record(
        self, place: tuple[float, float], pulses: list[Pulse]
    ) -> tuple[FloatArray, FloatArray]:
        height, start, tip = pulses[0]
        if self.habit == "frequencies wander":  # as supports and temperature let them
            usual = self.body
            self.body = replace(
                usual, frequency_hz=usual.frequency_hz * (1 + 2e-4 * self.rng.standard_normal())
            )
            found = super()._record(place, pulses)
            self.body = usual
            return found
        if self.habit == "hits soon after one another":
            rates = 2 * np.pi * self.body.frequency_hz * self.body.damping_ratio
            slowest = float(rates[self.body.frequency_hz > 5].min())
            # of the slowest mode's amplitude: up to half a per cent
            left = 10 ** self.rng.uniform(-3.5, -2.3)
            pulses = [*pulses, (height, start + np.log(left) / slowest, tip)]
        if self.habit == "hits of 1 to 6":
            share = np.exp(self.rng.uniform(-0.4, 0.4))
            # a harder hit is shorter
            pulses = [(height * share, start, tip * share**-0.3), *pulses[1:]]
        return super()._record(place, pulses)

    def _chain(
        self, force: FloatArray, response: FloatArray, fault: str | None
    ) -> tuple[FloatArray, FloatArray]:
        lab, rng = self.laboratory, self.rng
        time = np.arange(lab.samples) / lab.sample_rate_hz
        if self.habit == "drift":  # of a cable or a warming sensor
            for x, unit in ((force, lab.force_n), (response, self.scale)):
                x += (
                    unit
                    * 10 ** rng.uniform(-2.5, -1.3)
                    * np.exp(-time / rng.uniform(0.3, 3))
                    * rng.choice([-1, 1])
                )
                x += (
                    unit
                    * 10 ** rng.uniform(-3, -2)
                    * np.sin(2 * np.pi * (rng.uniform(0.2, 2) * time + rng.random()))
                )
        if self.habit == "swinging cords":
            size = self.scale * 10 ** rng.uniform(-4, -2)
            response = response + size * np.sin(2 * np.pi * (1.7 * time + rng.random())) * np.exp(
                -0.3 * time
            )
        if self.habit == "hammer rings":
            after = np.maximum(time - time[int(np.argmax(force))] - 2 * lab.tip_s, 0)
            force = force + 0.012 * force.max() * np.sin(2 * np.pi * 450 * after) * np.exp(
                -after / 0.01
            )
        if self.saturates:
            first = rng.random() < 0.5
            force, response = (
                (_saturated(force), response) if first else (force, _saturated(response))
            )
        return super()._chain(force, response, fault)


def _saturated(x: FloatArray) -> FloatArray:
    """What a soft amplifier makes of a signal that is 1.5 times what it can give."""
    top = np.abs(x).max() / 1.5
    return np.asarray(top * (x / top) / (1 + np.abs(x / top) ** 6) ** (1 / 6))


def instruments(lab: Laboratory, habit: str, rng: np.random.Generator) -> Laboratory:
    """The laboratory as the habit changes it."""
    changes: dict[str, float] = {}
    if habit == "hard tip":
        changes = {"tip_s": rng.uniform(1.5, 4.0) / lab.sample_rate_hz}
    if "soft tip" in habit:
        changes = {"tip_s": rng.uniform(20, 80) / lab.sample_rate_hz}
    if habit == "half-band filter":
        changes = {"filter_cut": 0.495, "tip_s": rng.uniform(2.0, 6.0) / lab.sample_rate_hz}
    if "short pretrigger" in habit:
        changes["pretrigger"] = int(rng.integers(20, 60))
    if habit == "offset":
        changes = {"offset": 10 ** rng.uniform(-1.5, -0.5)}
    if "hum" in habit:
        changes["hum"] = 10 ** rng.uniform(-2.5, -1.7)
    if habit == "16 steps of noise":
        changes = {
            "force_step": lab.force_n / 4096,
            "response_step": 1 / 4096,
            "force_noise": lab.force_n / 8192,
        }
        changes["response_noise"] = 1 / 16384
    return replace(lab, **changes)  # type: ignore[arg-type]  # fields of several types
