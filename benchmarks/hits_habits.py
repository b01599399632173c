"""Hits judged under what real instruments and hands do beyond `benchmarks.hammer`: tips of other stiffness, drift, hum,
offsets, short leads, hits that follow one another soon. None of it makes a hit a bad one, but for an amplifier that
saturates, which is counted apart.

The arguments are the campaigns of each habit and the seed. A tenth of
the hits has a fault. Each habit changes the laboratory (`instruments`) or what arrives at the converter (`HabitBench`).
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.hammer import FAULTS, PLACE_SD_M, Bench, Laboratory, Pulse, Simulated, random_body, random_laboratory
from fecore.arrays import FloatArray
from fecore.signal import Processing, by_point, process

HABITS = (
    "as simulated",
    "hard tip",
    "soft tip",
    "half-band filter",
    "short pretrigger",
    "soft tip, short pretrigger",
    "offset",
    "drift",
    "hum",
    "hum, short pretrigger",
    "swinging cords",
    "hits soon after one another",
    "hammer rings",
    "hits of 1 to 6",
    "16 steps of noise",
    "frequencies wander",
    "hand steadier at some points",
    "amplifier saturates",
)
CAMPAIGNS, POINTS, HITS, FAULTY, SEED = 3, 8, 5, 0.1, 5
_SATURATED = 0.25  # of the hits, where the amplifier saturates


class HabitBench(Bench):
    """A bench whose instruments have one habit."""

    habit = "as simulated"
    saturates = False

    def _record(self, place: tuple[float, float], pulses: list[Pulse]) -> tuple[FloatArray, FloatArray]:
        height, start, tip = pulses[0]
        if self.habit == "frequencies wander" and hasattr(self, "scale"):  # as supports and temperature let them
            usual = self.body
            self.body = replace(usual, frequency_hz=usual.frequency_hz * (1 + 2e-4 * self.rng.standard_normal()))
            found = super()._record(place, pulses)
            self.body = usual
            return found
        if self.habit == "hits soon after one another" and hasattr(self, "scale"):
            rates = 2 * np.pi * self.body.frequency_hz * self.body.damping_ratio
            slowest = float(rates[self.body.frequency_hz > 5].min())
            left = 10 ** self.rng.uniform(-3.5, -2.3)  # of the slowest mode's amplitude: up to half a per cent
            pulses = [*pulses, (height, start + np.log(left) / slowest, tip)]
        if self.habit == "hits of 1 to 6" and hasattr(self, "scale"):
            share = np.exp(self.rng.uniform(-0.4, 0.4))
            tip *= share**-0.3  # a harder hit is shorter
            pulses = [(height * share, start, tip), *pulses[1:]]
        return super()._record(place, pulses)

    def hit(self, label: int, place: tuple[float, float], number: int, fault: str | None = None) -> Simulated:
        """One hit; a hand that is steadier at some points lands 1 to 4 mm beside them, by point."""
        if self.habit == "hand steadier at some points" and fault != "off_place":
            more = np.sqrt(np.random.default_rng(label).uniform(0, 4)) * PLACE_SD_M * 0.9
            place = (place[0] + more * self.rng.standard_normal(), place[1] + more * self.rng.standard_normal())
        return super().hit(label, place, number, fault)

    def _chain(self, force: FloatArray, response: FloatArray, fault: str | None) -> tuple[FloatArray, FloatArray]:
        lab, rng = self.laboratory, self.rng
        time = np.arange(lab.samples) / lab.sample_rate_hz
        if self.habit == "drift":  # of a cable or a warming sensor
            for x, unit in ((force, lab.force_n), (response, self.scale)):
                x += unit * 10 ** rng.uniform(-2.5, -1.3) * np.exp(-time / rng.uniform(0.3, 3)) * rng.choice([-1, 1])
                x += unit * 10 ** rng.uniform(-3, -2) * np.sin(2 * np.pi * (rng.uniform(0.2, 2) * time + rng.random()))
        if self.habit == "swinging cords":
            size = self.scale * 10 ** rng.uniform(-4, -2)
            response = response + size * np.sin(2 * np.pi * (1.7 * time + rng.random())) * np.exp(-0.3 * time)
        if self.habit == "hammer rings":
            peak = int(np.argmax(force))
            after = np.maximum(time - time[peak] - 2 * lab.tip_s, 0)
            force = force + 0.012 * force.max() * np.sin(2 * np.pi * 450 * after) * np.exp(-after / 0.01)
        if self.saturates:
            if rng.random() < 0.5:
                force = _saturated(force)
            else:
                response = _saturated(response)
        return super()._chain(force, response, fault)


def _saturated(x: FloatArray) -> FloatArray:
    """What a soft amplifier makes of a signal that is 1.5 times what it can give."""
    top = np.abs(x).max() / 1.5
    return np.asarray(top * (x / top) / (1 + np.abs(x / top) ** 6) ** (1 / 6))


def instruments(lab: Laboratory, habit: str, rng: np.random.Generator) -> Laboratory:
    """A laboratory's instruments with a habit."""
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
        changes = {"force_step": lab.force_n / 4096, "response_step": 1 / 4096, "force_noise": lab.force_n / 8192}
        changes["response_noise"] = 1 / 16384
    return replace(lab, **changes)  # type: ignore[arg-type]  # fields of several types


def habit_campaign(
    rng: np.random.Generator, habit: str, kind: str, points: int, hits: int, faulty: float
) -> tuple[HabitBench, dict[int, tuple[float, float]], list[Simulated]]:
    """A campaign with one habit; a share of its hits has a fault, or, where the amplifier saturates, is saturated."""
    body, lab = random_body(rng, kind), instruments(random_laboratory(rng), habit, rng)
    bench = HabitBench(body, lab, (0.96 * body.length_m, 0.45 * body.width_m), rng)
    bench.habit = habit
    places = {
        n + 1: (rng.uniform(0.1, 0.98) * body.length_m, rng.uniform(-0.48, 0.48) * body.width_m) for n in range(points)
    }
    found: list[Simulated] = []
    for label, place in places.items():
        for number in range(1, hits + 1):
            fault = str(rng.choice(_faults(habit))) if rng.random() < faulty else None
            bench.saturates = habit == "amplifier saturates" and fault is None and rng.random() < _SATURATED
            hit = bench.hit(label, place, number, fault)
            found.append(replace(hit, fault="saturated") if bench.saturates else hit)
    return bench, places, found


def _faults(habit: str) -> Sequence[str]:
    """What may happen beside a habit."""
    return [f for f in FAULTS if not ("pretrigger" in habit and f == "late")]


def main(campaigns: int = CAMPAIGNS, seed: int = SEED) -> None:
    """Print the table."""
    print(f"{'habit':32}{'good hits':>10}{'thrown away':>13}  for                  faulty found")
    for habit in HABITS:
        rng = np.random.default_rng([seed, zlib.crc32(habit.encode())])
        hits, found, reasons = Counter[str](), Counter[str](), Counter[str]()
        for number in range(campaigns):
            kind = ("clamped", "free", "plate")[number % 3]
            _, places, simulated = habit_campaign(rng, habit, kind, POINTS, HITS, FAULTY)
            positions = {label: (*place, 0.0) for label, place in places.items()}
            verdicts = process(by_point([s.hit for s in simulated]), Processing(positions=positions)).verdicts
            for one, verdict in zip(simulated, verdicts, strict=True):
                hits[one.fault or "good"] += 1
                found[one.fault or "good"] += not verdict.accepted
                reasons.update({f.criterion for f in verdict.faults} if one.fault is None else ())
        faults = ", ".join(f"{name} {found[name]}/{hits[name]}" for name in sorted(hits) if name != "good")
        reason = ", ".join(f"{name} {count}" for name, count in reasons.items())
        print(f"{habit:32}{hits['good']:10}{found['good'] / hits['good']:13.1%}  {reason:20} {faults}")
