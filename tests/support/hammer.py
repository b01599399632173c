"""Hammer tests of random bodies, simulated in time: what a laboratory's analyser records, with the
faults that people make.

A body is a set of modes with analytic shapes (clamped and free beams that bend and twist, free
plates). A pulse sin² of random length and height lands 2 mm (one standard deviation) beside its
point; the modes are integrated at eight times the sampling rate, pass a linear-phase anti-alias
filter and the 0.5 Hz high-pass of an ICP sensor, and get an offset, hum, white noise and
the steps of a converter. So the truth of a hit is known: its fault, and the FRF between the two
points.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.frf import Dof
from fecore.signal import Block, Hit

FAULTS = ("double", "clip_force", "clip_response", "early", "late", "off_place", "quiet")
PLACE_SD_M = 0.002
OFF_PLACE_M = 0.012
Pulse = tuple[float, float, float]  # height in N, start and length in s
_FINE = 8
_TAPS = 48  # samples that the anti-alias filter reaches to either side
CLAMPED = np.array([1.8751, 4.6941, 7.8548, 10.9955, 14.1372, 17.2788, 20.4204, 23.5619])
FREE = np.array([4.7300, 7.8532, 10.9956, 14.1372, 17.2788, 20.4204, 23.5619, 26.7035])


@dataclass(frozen=True)
class Body:
    """A vibrating body: `kind` is clamped, free or plate; modes by frequency, damping and orders
    along x and y.
    """

    kind: str
    length_m: float
    width_m: float
    mass_kg: float
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    orders: tuple[tuple[int, int], ...]

    def shapes(self, place: tuple[float, float]) -> FloatArray:
        """(m,) mass-normalised shapes at x, y in m; x from the clamped end, y from the middle."""
        x, y = place[0] / self.length_m, place[1] / self.width_m
        along = {
            k: _across(k, x) if self.kind != "clamped" else _clamped(k, x) for k, _ in self.orders
        }
        twist = {j: _across(j, y + 0.5) for _, j in self.orders}
        if self.kind == "clamped":
            values = [
                along[k] * twist[j] if j == 0 else _twist(k, x) * twist[j] for k, j in self.orders
            ]
        else:
            values = [along[k] * twist[j] for k, j in self.orders]
        return np.array(values) / np.sqrt(self.mass_kg)

    def accelerance(
        self, frequency_hz: FloatArray, response: FloatArray, force: FloatArray
    ) -> ComplexArray:
        """(L,) exact FRF between two places given by their shapes."""
        w, w0 = 2 * np.pi * frequency_hz[:, None], 2 * np.pi * self.frequency_hz
        terms = (
            response * force * -(w**2) / (w0**2 - w**2 + 2j * self.damping_ratio * w0 * w + 1e-300)
        )
        return np.asarray(terms.sum(axis=1))


def _clamped(k: int, x: float) -> float:
    b = CLAMPED[k - 1]
    s = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))
    return float(np.cosh(b * x) - np.cos(b * x) - s * (np.sinh(b * x) - np.sin(b * x)))


def _twist(k: int, x: float) -> float:
    return float(np.sqrt(2) * np.sin((k - 0.5) * np.pi * x))


def _across(k: int, x: float) -> float:
    """Free-free beam function k: 0 and 1 are rigid."""
    if k == 0:
        return 1.0
    if k == 1:
        return float(np.sqrt(3) * (2 * x - 1))
    b = FREE[k - 2]
    s = (np.cosh(b) - np.cos(b)) / (np.sinh(b) - np.sin(b))
    return float(np.cosh(b * x) + np.cos(b * x) - s * (np.sinh(b * x) + np.sin(b * x)))


def random_body(rng: np.random.Generator, kind: str) -> Body:
    """A body drawn at random: a strip of 0.25 to 0.8 m, or a thin plate."""
    length = rng.uniform(0.25, 0.8)
    width = rng.uniform(0.05, 0.12) * length if kind != "plate" else rng.uniform(0.3, 0.8) * length
    first, ratio = (
        (rng.uniform(20, 80), rng.uniform(4, 18))
        if kind != "plate"
        else (rng.uniform(40, 120), 1.0)
    )
    modes: list[tuple[float, int, int]] = []
    if kind == "clamped":
        modes += [(first * (CLAMPED[k] / CLAMPED[0]) ** 2, k + 1, 0) for k in range(8)]
        modes += [(first * ratio * (2 * k + 1), k + 1, 1) for k in range(6)]
    elif kind == "free":
        first *= 3
        modes += [(first * (FREE[k] / FREE[0]) ** 2, k + 2, 0) for k in range(8)]
        modes += [(first * ratio / 3 * k, k, 1) for k in range(1, 7)]
    else:
        across = (length / width) ** 2 * rng.uniform(0.25, 1.0)
        for k in range(9):
            for j in range(6):
                if k + j >= 2:
                    bend = (
                        FREE[k - 2] ** 2 if k > 1 else 0,
                        across * FREE[j - 2] ** 2 if j > 1 else 0,
                    )
                    twist = 0.6 * np.sqrt(across) * (k * np.pi) * (j * np.pi)
                    modes.append(
                        (first / 22 * float(np.sqrt(bend[0] ** 2 + bend[1] ** 2 + twist**2)), k, j)
                    )
    if kind != "clamped":  # on soft cords
        modes += [(rng.uniform(1.0, 3.0), k, j) for k, j in ((0, 0), (1, 0), (0, 1))]
    modes.sort()
    f = np.array([m[0] for m in modes]) * np.exp(0.02 * rng.standard_normal(len(modes)))
    mass = length * width * rng.uniform(0.003, 0.012) * rng.uniform(400, 2700)
    rate, slope = np.exp(rng.uniform(np.log(1.0), np.log(25.0))), rng.uniform(0, 4e-6)
    zeta = np.maximum((rate / (2 * np.pi * f) + slope * 2 * np.pi * f) / 2, 2e-4)
    zeta = np.where(f < 5, 0.04, zeta)
    return Body(kind, length, width, mass, f, zeta, tuple((k, j) for _, k, j in modes))


@dataclass(frozen=True)
class Laboratory:
    """Hammer, sensor and analyser of one campaign: `tip_s` the pulse's length, steps and noise in N
    and m/s².
    """

    sample_rate_hz: float
    samples: int
    pretrigger: int
    tip_s: float
    force_n: float
    force_noise: float
    response_noise: float
    hum: float
    offset: float
    force_step: float
    response_step: float
    filter_cut: float
    high_pass: bool
    window_rate_per_s: float
    delay_s: float = 0.0
    window_first: bool = False  # before the converter, whose steps then do not decay


def random_laboratory(
    rng: np.random.Generator, window_rate_per_s: float | None = None
) -> Laboratory:
    """Instruments drawn at random; the response's noise is a share of 1 m/s² per N until the body
    scales it.
    """
    rate = float(rng.choice([3200.0, 6400.0, 12800.0]))
    samples = int(rng.choice([4096, 8192, 16384]))
    force = float(np.exp(rng.uniform(np.log(15), np.log(400))))
    return Laboratory(
        sample_rate_hz=rate,
        samples=samples,
        pretrigger=int(samples * rng.uniform(0.015, 0.05)),
        tip_s=rng.uniform(1.2, 4.0) / (rate / 2.56) * 1.5,
        force_n=force,
        force_noise=force * 10 ** rng.uniform(-4.0, -2.6),
        response_noise=10 ** rng.uniform(-4.3, -3.0),
        hum=10 ** rng.uniform(-4.5, -3.2),
        offset=10 ** rng.uniform(-4.0, -2.5),
        force_step=force * 10 ** rng.uniform(-4.5, -3.0),
        response_step=10 ** rng.uniform(-4.5, -3.7),
        filter_cut=rng.uniform(0.40, 0.46),
        high_pass=bool(rng.random() < 0.7),
        window_rate_per_s=(
            float(rng.choice([0, 0, 0, 1.0, 3.0]))
            if window_rate_per_s is None
            else window_rate_per_s
        ),
    )


@dataclass(frozen=True)
class Simulated:
    """A hit as recorded and the truth of it."""

    hit: Hit
    fault: str | None
    place: tuple[float, float]


class Bench:
    """A body in a laboratory: hits any point, one sensor at a fixed place.

    Attributes:
        faults: those that its hits may have.
        places: of the points of its tour.
    """

    faults: Sequence[str] = FAULTS
    places: dict[int, tuple[float, float]]

    def __init__(
        self,
        body: Body,
        laboratory: Laboratory,
        sensor: tuple[float, float],
        rng: np.random.Generator,
    ) -> None:
        keep = body.frequency_hz < 0.98 * laboratory.filter_cut * laboratory.sample_rate_hz
        self.body = replace(
            body,
            frequency_hz=body.frequency_hz[keep],
            damping_ratio=body.damping_ratio[keep],
            orders=tuple(o for o, k in zip(body.orders, keep, strict=True) if k),
        )
        self.laboratory, self.rng = laboratory, rng
        self.sensor = self.body.shapes(sensor)
        place = (0.71 * body.length_m, 0.31 * body.width_m)
        usual = np.abs(
            self._record(
                place, [(1.0, laboratory.pretrigger / laboratory.sample_rate_hz, laboratory.tip_s)]
            )[1]
        ).max()
        self.scale = float(usual) * laboratory.force_n  # m/s² of a usual hit

    def accelerance(
        self, frequency_hz: FloatArray, place: tuple[float, float], rate: float = 0.0
    ) -> ComplexArray:
        """(L,) exact FRF for a hit at a place; at s = iω + r, which an exponential window of the
        rate r makes of it.
        """
        delay = np.exp(-2j * np.pi * frequency_hz * self.laboratory.delay_s)
        shown_hz: Any = frequency_hz - 0.5j * rate / np.pi
        return self.body.accelerance(shown_hz, self.sensor, self.body.shapes(place)) * delay

    def hit(
        self, label: int, place: tuple[float, float], number: int, fault: str | None = None
    ) -> Simulated:
        """One hit of the grid point `label` at `place`, with a fault or without."""
        lab, rng = self.laboratory, self.rng
        spread = OFF_PLACE_M if fault == "off_place" else 0.0
        angle = rng.uniform(0, 2 * np.pi)
        real = (
            place[0] + spread * np.cos(angle) + PLACE_SD_M * rng.standard_normal(),
            place[1] + spread * np.sin(angle) + PLACE_SD_M * rng.standard_normal(),
        )
        height = (
            lab.force_n
            * np.exp(rng.uniform(-0.5, 0.5))
            * (rng.uniform(0.04, 0.13) if fault == "quiet" else 1.0)
        )
        start = (lab.pretrigger + rng.uniform(-0.1, 0.1) * lab.pretrigger) / lab.sample_rate_hz
        if fault == "late":
            start = -lab.tip_s * rng.uniform(0.3, 1.5)
        tip = lab.tip_s * np.exp(0.12 * rng.standard_normal())
        pulses = [(height, start, tip)]
        if fault == "double":
            pulses.append(
                (height * rng.uniform(0.07, 0.6), start + 4 * tip + rng.uniform(0.002, 0.05), tip)
            )
        if fault == "early":
            pulses.append((lab.force_n * np.exp(rng.uniform(-0.5, 0.5)), start - self._gap(), tip))
        force, response = self._record(real, pulses)
        force, response = self._chain(force, response, fault)
        dof, sensor = Dof(label, 3), Dof(9999, 3)
        blocks = (
            Block(dof, "force", force, window_rate_per_s=lab.window_rate_per_s),
            Block(sensor, "acceleration", response, window_rate_per_s=lab.window_rate_per_s),
        )
        return Simulated(Hit(blocks[0], blocks[1:], lab.sample_rate_hz, number), fault, real)

    def tour(self, points: int, hits: int, faulty: float) -> list[Simulated]:
        """So many hits of each of so many places, a share of them with a fault."""
        body, rng, found = self.body, self.rng, list[Simulated]()
        self.places = {
            n + 1: (rng.uniform(0.1, 0.98) * body.length_m, rng.uniform(-0.48, 0.48) * body.width_m)
            for n in range(points)
        }
        for label, place in self.places.items():
            for number in range(1, hits + 1):
                fault = str(rng.choice(self.faults)) if rng.random() < faulty else None
                found.append(self.hit(label, place, number, fault))
        return found

    def _gap(self) -> float:
        """Seconds to the hit before, so that 2 to 30 % of its slowest mode's amplitude is still
        there.
        """
        rates = 2 * np.pi * self.body.frequency_hz * self.body.damping_ratio
        slowest = float(rates[self.body.frequency_hz > 5].min())
        lab = self.laboratory
        outside = (
            1.5 * lab.pretrigger + 2 * _TAPS
        ) / lab.sample_rate_hz + 2 * lab.tip_s  # its pulse is not in the block
        return max(-np.log(self.rng.uniform(0.02, 0.3)) / slowest, outside)

    def _record(
        self, place: tuple[float, float], pulses: list[Pulse]
    ) -> tuple[FloatArray, FloatArray]:
        """(n,) force and acceleration after the anti-alias filter."""
        lab = self.laboratory
        gain = self.body.shapes(place) * self.sensor
        omega, zeta = 2 * np.pi * self.body.frequency_hz, self.body.damping_ratio
        poles = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
        force, response = np.zeros(lab.samples), np.zeros(lab.samples)
        for height, start, tip in pulses:
            first = int(np.floor(start * lab.sample_rate_hz)) - _TAPS
            last = int(np.ceil((start + tip) * lab.sample_rate_hz)) + _TAPS
            near = self._near(gain, poles, (height, start, tip), first, last)
            low, high = max(first, 0), min(last, lab.samples)
            if high > low:
                force[low:high] += near[0][low - first : high - first]
                response[low:high] += near[1][low - first : high - first]
            # free decay from there on
            time = np.arange(max(last, 0), lab.samples) / lab.sample_rate_hz - start
            decay = gain * self._laplace(poles, height, tip) * poles**2 / poles.imag
            response[max(last, 0) :] += (decay @ np.exp(poles[:, None] * time)).imag
        if lab.delay_s:
            shift = np.exp(
                -2j * np.pi * np.fft.rfftfreq(lab.samples, 1 / lab.sample_rate_hz) * lab.delay_s
            )
            response = np.fft.irfft(np.fft.rfft(response) * shift, lab.samples)
        return force, response

    def _near(
        self, gain: FloatArray, poles: ComplexArray, pulse: Pulse, first: int, last: int
    ) -> tuple[FloatArray, FloatArray]:
        """Force and acceleration of the samples `first` to `last` about a pulse, integrated on the
        fine grid.
        """
        from scipy import signal  # takes a second to load

        lab, (height, start, tip) = self.laboratory, pulse
        fine = lab.sample_rate_hz * _FINE
        time = np.arange((first - _TAPS) * _FINE, (last + _TAPS) * _FINE) / fine - start
        force = np.where((time > 0) & (time < tip), height * np.sin(np.pi * time / tip) ** 2, 0.0)
        response = gain.sum() * force
        # q'' = F + Im(p² ∫ F exp(p (t - s)) ds) / ω_d
        for amplitude, pole in zip(gain, poles, strict=True):
            ringing = (
                signal.lfilter([1.0], [1.0, -np.exp(pole / fine)], force.astype(complex)) / fine
            )
            response += amplitude * (pole**2 / pole.imag * ringing).imag
        taps = signal.firwin(
            2 * _TAPS * _FINE + 1, 2 * lab.filter_cut / _FINE, window=("kaiser", 9.0)
        )
        whole = [
            signal.upfirdn(taps, x, down=_FINE)[2 * _TAPS :][: last - first]
            for x in (force, response)
        ]
        return whole[0], whole[1]

    def _laplace(self, poles: ComplexArray, height: float, tip: float) -> ComplexArray:
        t = np.linspace(0, tip, 200)
        pulse = height * np.sin(np.pi * t / tip) ** 2
        return np.asarray(np.trapezoid(pulse * np.exp(-poles[:, None] * t), t, axis=1))

    def _chain(
        self, force: FloatArray, response: FloatArray, fault: str | None
    ) -> tuple[FloatArray, FloatArray]:
        """High-pass, offset, hum, noise, overload, converter and window of both channels."""
        from scipy import signal

        lab, rng = self.laboratory, self.rng
        time = np.arange(lab.samples) / lab.sample_rate_hz
        channels = []
        for name, values, unit, noise, step in (
            ("force", force, lab.force_n, lab.force_noise, lab.force_step),
            (
                "response",
                response,
                self.scale,
                lab.response_noise * self.scale,
                lab.response_step * self.scale,
            ),
        ):
            x = values
            if lab.high_pass:
                x = signal.lfilter(*signal.butter(1, 0.5, "highpass", fs=lab.sample_rate_hz), x)
            x = (
                x
                + lab.offset * unit * rng.standard_normal()
                + noise * rng.standard_normal(lab.samples)
            )
            for k in (1, 2, 3):
                x = x + lab.hum * unit / k * np.sin(2 * np.pi * (50 * k * time + rng.random()))
            if fault == f"clip_{name}":
                level = rng.uniform(0.5, 0.85) * np.abs(x).max()
                x = np.clip(x, -level, level)
            window = np.exp(-lab.window_rate_per_s * time)
            before, behind = (window, 1.0) if lab.window_first else (1.0, window)
            channels.append(np.round(x * before / step) * step * behind)
        return channels[0], channels[1]


def campaign(
    rng: np.random.Generator,
    kind: str,
    points: int,
    hits: int,
    faulty: float,
    window_rate_per_s: float | None = None,
    make: Callable[..., Bench] = Bench,
) -> tuple[Bench, dict[int, tuple[float, float]], list[Simulated]]:
    """A whole campaign: the bench, the places of its points, and its hits in order.

    Args:
        rng: draws all of it.
        kind: of the body.
        points: how many.
        hits: of each point.
        faulty: share of the hits that have a fault.
        window_rate_per_s: of an exponential window; drawn by default.
        make: the bench of a body, a laboratory and the sensor's place.
    """
    body, lab = random_body(rng, kind), random_laboratory(rng, window_rate_per_s)
    bench = make(body, lab, (0.96 * body.length_m, 0.45 * body.width_m), rng)
    simulated = bench.tour(points, hits, faulty)
    return bench, bench.places, simulated
