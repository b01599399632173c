"""Updates of bodies whose constants are known: how far off they are, and whether their intervals hold the truth.

`benchmarks.draws` says what is drawn. Each case runs the default recipe on what a laboratory states.

real_bodies    table [words of a row]: one deviation at a time; drawn N: all of them; perfect N: none
wooden_plates  N plates from a handbook's constants, with shapes, one FRF, or frequencies alone
laboratories   N laboratories from a seed, then the same with one fault each
independent    N beams of CalculiX's solid elements, by a seed
campaigns      coverage N seed: panels of several tests; solids N seed: those by CalculiX; plans N seed: which points to hit
"""

import re
import shutil
import time
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks import calculix, draws
from benchmarks import laboratories as drawing
from benchmarks.draws import Drawn, Truth
from fecore.errors import FecoreError
from fecore.frf import Dof, along_z
from fecore.modes import MeasuredModes
from fecore.normal import Z_95
from fecore.updating.campaigns import Campaign, update_campaigns
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update
from fecore.updating.plans import plan_tests
from fecore.updating.result import ParameterEstimate
from tests.support.strips import PLATE, STRIP, TRUTH, measured, panel
from tests.unit.fecore.updating.test_plans import effective_independence, random_beam


@dataclass
class Found:
    """What the update made of a drawn body: its error or "", and of each constant whose truth is known, by name:"""

    error: str = ""  # of the core; any other ends the benchmark
    level: str = "failed"  # of the verdict
    warnings: tuple[str, ...] = ()  # of the result
    estimates: dict[str, ParameterEstimate] = field(default_factory=dict)  # the constants
    off: dict[str, float] = field(default_factory=dict)  # relative error of each
    held: dict[str, bool] = field(default_factory=dict)  # whether the 95 % interval holds the truth
    half: dict[str, float] = field(default_factory=dict)  # half the interval over the truth
    seconds: float = 0.0  # of the processor


def judge(drawn: Drawn) -> Found:
    """Run the default recipe and compare each constant with the truth."""
    began = time.process_time()
    try:
        result = update(drawn.measurement, drawn.stated)
    except FecoreError as error:
        return Found(f"{type(error).__name__}: {error}", seconds=time.process_time() - began)
    found = Found("", result.verdict.level, result.warnings, seconds=time.process_time() - began)
    for p in result.parameters:
        if (true := drawn.true.get(p.name)) is not None:
            (low, high), scale = p.interval_95, true or np.nan  # a0 of damping by stiffness alone is nothing
            found.estimates[p.name], found.off[p.name] = p, p.estimate / scale - 1
            found.held[p.name], found.half[p.name] = low <= true <= high, (high - low) / 2 / scale
    return found


def _percent(held: Iterable[bool]) -> str:
    return f"{100 * np.mean(list(held)):5.1f} %"


def real_bodies(what: str = "table", *rest: str | int) -> None:
    """One deviation at a time, or many bodies with all of them or none."""
    if what == "table":
        _table(" ".join(map(str, rest)))
    else:
        _drawn(int(rest[0]), what == "perfect")


TABLE = {
    "nothing": Truth(),
    **{f"clamp kL/EI = {k}": Truth(clamp=1 / k) for k in (500, 200, 75)},
    **{f"length +{mm} mm": Truth(length=mm * 1e-3) for mm in (1, 3)},
    **{f"thickness stated +{p} %": Truth(thickness=-p / 100) for p in (0.5, 1.2, 3)},
    "density stated -3 %": Truth(density=0.03),
    **{f"fibres {d}° off": Truth(angle=np.radians(d)) for d in (2, 4)},
    **{f"unstated sensor of {g} g": Truth(sensor=g * 1e-3) for g in (1, 2)},
    **{f"window of {tau} s": Truth(window=1 / tau) for tau in (1, 0.25)},
    "30 µs between channels": Truth(delay=30e-6),
}


def _table(word: str) -> None:
    """Error over standard deviation of the constant that each deviation moves most, and the verdict."""
    print(f"{'true deviation':26} {'':3} {'error %':>8} {'z':>6}  verdict")
    true = {**{n: getattr(draws.NOMINAL, n) for n in ("Ex", "Gxy")}, "a0": draws.LAW[0], "a1": draws.LAW[1]}
    for name, truth in ((name, truth) for name, truth in TABLE.items() if word in name):
        given = draws.measured(truth, draws.NOMINAL, np.random.default_rng(1))
        found = judge(Drawn(replace(draws.STATED, boundary=truth.boundary), given, true))  # type: ignore[arg-type]
        watched = "a0" if truth.window else "a1" if truth.delay else "Ex"
        z = found.off[watched] * true[watched] / found.estimates[watched].standard_deviation
        print(f"{name:26} {watched:3} {100 * found.off[watched]:8.2f} {z:6.2f}  {found.level}", flush=True)


def _drawn(bodies: int, perfect: bool) -> None:
    """How often each interval holds the truth, and how wide it is."""
    every = [judge(draws.real(seed, perfect=perfect)) for seed in range(bodies)]
    for seed, found in enumerate(every):
        if found.error:
            print(f"  body {seed}: {found.error}")
    failed = sum(bool(found.error) for found in every)
    print(f"\n{bodies} bodies, {'perfect' if perfect else 'with every deviation drawn'}, {failed} not updated")
    print("  held: intervals that hold the truth; rms: of the error over a quarter of the interval, 1 at best;")
    print("  half: median of half an interval, as a share of the truth")
    for name in ("Ex", "Ey", "Gxy", "Gxz", "a0", "a1"):
        rows = [(each.held[name], each.off[name], each.half[name]) for each in every if name in each.held]
        held, off, half = (np.array(column) for column in zip(*rows, strict=True))
        rms = np.sqrt(np.mean((off / half * Z_95) ** 2))
        print(f"  {name:4} held {_percent(held)}   rms {rms:5.2f}   half {100 * np.median(half):6.2f} %")
    zero = sum(p.interval_95[0] <= 0 for each in every for p in each.estimates.values() if p.unit == "Pa")
    levels = dict(Counter(each.level for each in every))
    print(f"  verdicts: {levels}; moduli with an interval that reaches zero: {zero}")


def wooden_plates(plates: int = 20) -> None:
    """An optimum is wrong where a modulus is off by more than 10 %, and silent where the verdict does not warn of it."""
    every: dict[str, list[Found]] = defaultdict(list)
    for seed in range(plates):
        for kind, drawn in draws.plate(seed).items():
            every[kind].append(found := judge(drawn))
            if found.error or _wrong(found):
                off = ", ".join(f"{name} {100 * value:+.0f} %" for name, value in found.off.items())
                print(f"  plate {seed}, {kind}: {found.error or off} ({found.level})", flush=True)
    print(f"{plates} plates: wrong optimum, without a warning, intervals that hold the truth, verdicts, processor each")
    for kind, row in every.items():
        silent = sum(_wrong(each) and each.level == "usable" for each in row)
        print(
            f"  {kind:12} wrong {sum(map(_wrong, row)):3}  silent {silent:3}  "
            f"hold {_percent(ok for each in row for ok in each.held.values())}  "
            f"{dict(Counter(each.level for each in row))}  {sum(each.seconds for each in row) / plates:.1f} s"
        )


def _wrong(found: Found) -> bool:
    return max(map(abs, found.off.values()), default=0.0) > 0.1


def laboratories(sets: int = 40, seed: int = 1) -> None:
    """Coverage by class, and what became of each fault."""
    honest = [(drawn, judge(drawn)) for drawn in map(drawing.draw, range(seed, seed + sets))]
    print(f"  {sets} laboratories without a fault: {sum(not found.error for _, found in honest)} updated")
    for error, count in Counter(found.error[:90] for _, found in honest if found.error).most_common():
        print(f"    {count} × {error}")
    classes = defaultdict(list)
    for drawn, found in honest:
        sure = {name: ok for name, ok in found.held.items() if found.estimates[name].identifiable}
        for name, value in drawn.kind.items():
            classes[name, value] += list(sure.values())
        for name, ok in sure.items():
            classes["parameter", name].append(ok)
    print("  95 % intervals of identifiable parameters that hold the truth")
    for (name, value), held in sorted(classes.items()):
        if held:
            print(f"    {name:10s} {value:16s} {_percent(held)} of {len(held)}")
    times = [found.seconds for _, found in honest]
    print(f"  processor: median {np.median(times):.2f} s, longest {max(times):.1f} s")
    print("  faults:     refused   warned  silent, with a wrong interval")
    for place, fault in enumerate(drawing.FAULTS):
        numbers = [k for k in range(place, sets, len(drawing.FAULTS)) if not honest[k][1].error]
        pairs = [(judge(drawing.draw(seed + k, fault)), _kinds(honest[k][1])) for k in numbers]
        refused = sum(bool(each.error) for each, _ in pairs)
        silent = [each for each, usual in pairs if not each.error and not _kinds(each) - usual]
        wrong = sum(
            not all(ok for name, ok in each.held.items() if each.estimates[name].identifiable) for each in silent
        )
        print(f"    {fault:12s} {refused:5d} {len(pairs) - refused - len(silent):6d} {len(silent):7d} {wrong:8d}")


def _kinds(found: Found) -> set[str]:
    """Warnings without their numbers."""
    return {re.sub(r"[\d.]+", "", warning) for warning in found.warnings}


TOLERANCE = {"Ex": 0.5, "Gxy": 1.0, "a0": 1.0, "a1": 1.0}  # percent, times the noise in percent, at most twice


def independent(sets: int = 12, seed: int = 2026) -> None:
    """Errors and intervals of each beam; `!` beyond tolerance, `*` an interval that misses."""
    if shutil.which("ccx") is None:
        print("  (ccx is not installed: no beams of another code)")
        return
    print(f"  body; errors in % of {', '.join(TOLERANCE)}; ! beyond tolerance, * interval misses")
    rng, within, held = np.random.default_rng(seed), list[bool](), list[bool]()
    for _ in range(sets):
        drawn = draws.solid(rng)
        found, allowed = judge(drawn), min(max(100 * float(drawn.kind["noise"]), 1), 2)
        held += [ok for name, ok in found.held.items() if name != "Gyz"]  # tied to Gxz, which is another constant here
        fine = {name: abs(100 * found.off[name]) <= allowed * tolerance for name, tolerance in TOLERANCE.items()}
        within += fine.values()
        shown = [
            f"{100 * found.off[n]:+7.2f}{' ' if fine[n] else '!'}{' ' if found.held[n] else '*'}" for n in TOLERANCE
        ]
        shown += [f"{n}*" for n, ok in found.held.items() if not ok and n not in (*TOLERANCE, "Gyz")]
        print(f"  {', '.join(drawn.kind.values()):34}  {' '.join(shown)}", flush=True)
    print(
        f"  within tolerance {sum(within)} of {len(within)}; intervals that hold the truth {sum(held)} of {len(held)}"
    )


# --- several tests of one material --------------------------------------------------------------------------------------

CUTS = (("strip 0", STRIP, 0.0), ("strip 90", STRIP, 90.0), ("strip 45", STRIP, 45.0), ("plate", PLATE, 0.0))
MODES, NOISE = 9, 3e-4


def campaigns(what: str = "coverage", count: int = 8, seed: int = 1) -> None:
    """Joint updates of strips and a plate whose truth is a plate on another mesh or solids by CalculiX; or plans."""
    if what == "plans":
        _plans(count, seed)
        return
    for number in range(count):
        key = [seed, number]
        if what == "coverage":
            drawn = panel(np.random.default_rng(key), modes=MODES)
        else:
            drawn = [_of_solids(np.random.default_rng([*key, k]), *cut) for k, cut in enumerate(CUTS)]
        # A mesh as the update chooses it, not the tests' coarse one, by which Gyz comes out 10 to 15 % low.
        _judge_panel(number, [replace(each, body=replace(each.body, divisions=None)) for each in drawn], what)


def _judge_panel(number: int, panel: list[Campaign], what: str) -> None:
    """Intervals that hold the truth, deviations over the prior's, and the time over that of the single updates."""
    start = time.process_time()
    result = update_campaigns(panel)
    together = time.process_time() - start
    held = [p.interval_95[0] <= TRUTH[p.name] <= p.interval_95[1] for p in result.parameters]
    shown = "  ".join(
        f"{p.name} {100 * (p.estimate / TRUTH[p.name] - 1):+.1f} %"
        f" (sd/prior {p.standard_deviation / (p.prior_sd or np.nan):.2f})"
        for p in result.parameters
    )
    ratio = ""
    if what == "coverage" and number < 3:
        start = time.process_time()
        for campaign in panel:
            update_campaigns([campaign])
        ratio = f", {together / (time.process_time() - start):.1f} times its single updates"
    print(f"  {number + 1}: {shown}; held {sum(held)} of {len(held)}{ratio}; odd one {result.odd_one_out}", flush=True)


def _of_solids(random: np.random.Generator, name: str, size: tuple[float, float, float], angle: float) -> Campaign:
    """A campaign whose truth is a free body of solid elements, its dimensions, density and angle off the stated ones."""
    stated = measured(random, name, size, angle, modes=MODES)
    nominal, inputs = stated.body.nominal, stated.inputs
    names = ("length", "width", "thickness", "density", "fibre_angle")
    length, width, thickness, density, turned = (
        nominal[key] + inputs.standard_deviation(key, nominal[key]) * random.standard_normal() for key in names
    )
    nx, ny = (24, 16) if size[1] > 0.1 else (40, 6)
    along, across = np.arange(1, 2 * nx, max(1, nx // 5)), np.arange(1, 2 * ny, max(1, ny // 2))
    shares = np.array([(i // 2 / nx, j // 2 / ny - 0.5, 0.0) for i in along for j in across])
    constants = TRUTH | {"Ez": 10e9, "nu_xz": 0.28, "nu_yz": 0.35, "density": density}  # what a plate does not show
    body = calculix.plate((nx, ny, 2), (length, width, thickness), constants, turned)
    hz, motion = calculix.modes(body, MODES + 12, body.nearest(shares * (length, width, 0.0)))
    square = np.sum(motion**2, axis=1)
    kept = np.flatnonzero((hz > 1.0) & (square[:, 2] > square[:, 0] + square[:, 1]))[:MODES]  # out of the plane
    hz, shapes = hz[kept] * (1 + NOISE * random.standard_normal(MODES)), motion[kept, :, 2]
    points = {label: tuple(map(float, place)) for label, place in enumerate(shares * (*size[:2], 0.0), start=1)}
    covariance = np.diag(np.concatenate([(NOISE * hz) ** 2, np.full(MODES, 1e-8)]))
    dofs = tuple(Dof(label, 3) for label in points)
    modes = MeasuredModes(hz, np.full(MODES, 0.01), shapes + 0j, dofs, covariance)
    return replace(stated, modes=modes, points=points)


def _plans(beams: int, seed: int) -> None:
    """Do eight points keep what a tour of 33 would give, and more than effective independence chooses?"""
    random, near, better = np.random.default_rng(seed), 0, 0
    for _ in range(beams):
        test = random_beam(random)
        (whole,), (chosen,) = plan_tests([test]).forecasts, plan_tests([test], count=8).forecasts
        prior = parametrise(test.body)
        forward = ForwardModel(test.body, prior, along_z(range(33)), np.array(test.points), 12)
        shapes = forward.solve(prior.prior_mean).shapes[: whole.frequencies_hz.size]
        (theirs,) = plan_tests([replace(test, hit=effective_independence(shapes, 8))]).forecasts
        near += whole.information - chosen.information < np.log(1.1)
        better += chosen.information > theirs.information
    print(f"{beams} beams: within 10 % of the tour on {near}, better than effective independence on {better}")
