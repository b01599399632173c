"""Profiles and panels as solids by CalculiX, two bricks through each wall, against shells with
joints.

Walls of one material and unlike thickness leave the errors of the joint model; solids of this
fineness are .1 to .3 % too stiff at corners. Profiles drawn at random are measured and updated from
what a laboratory would know: dimensions, thickness ratios, constants, damping, supports and points
are others in each draw.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from benchmarks.structures import rms_and_worst, update_printed
from benchmarks.tables import Off, Table, print_coverage
from fecore.frf import Dof, FrfSet
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement
from tests.support import calculix, panels
from tests.support.beams import add_noise
from tests.support.stored_solids import body, frequencies, stated

WALL = {
    "E1": 28.8e9, "E2": 9.2e9, "E3": 8.3e9, "nu12": 0.245, "nu13": 0.3, "nu23": 0.35,
    "G12": 3.13e9, "G13": 2.82e9, "G23": 2.35e9, "rho": 1850.0,
}  # fmt: skip
# kind, length, height, width, flange or plate, web or rib, in mm
CASES = (
    *(("i", 800, 120, 60, 6, 6), ("i", 800, 120, 60, 10, 5), ("i", 800, 120, 60, 5, 10)),
    *(("panel", 800, 50, 400, 4, 10), ("panel", 800, 50, 400, 10, 4)),
    *(("angle", 600, 60, 60, 6, 6), ("angle", 600, 60, 60, 8, 4), ("angle", 600, 60, 60, 4, 8)),
    *(("channel", 700, 100, 50, 8, 4), ("channel", 700, 100, 50, 4, 8)),
)
_NINE = ("E1", "E2", "E3", "nu12", "nu13", "nu23", "G12", "G13", "G23")


def section(
    kind: str, d: dict[str, float]
) -> tuple[list[float], list[float], Callable[..., bool], Callable[..., bool]]:
    """Lines at which cells begin along y and z, and whether a point is in the flange, and else in
    the web.
    """
    side, top, tf, tw = d["b"] / 2, d["h"] / 2, d["tf"], d["tw"]
    y, z = [-side, -tw / 2, tw / 2, side], [-top, -top + tf, top - tf, top]
    if kind == "panel":
        rib = d["b"] / 4
        y = [-side, *(at + half for at in (-rib, rib) for half in (-tw / 2, tw / 2)), side]
        return (
            y,
            [-top, top - tf, top],
            lambda _, z: z > top - tf,
            lambda y, _: abs(abs(y) - rib) < tw / 2,
        )
    if kind == "box":
        y = [-side, -side + tw, side - tw, side]
        return y, z, lambda _, z: abs(z) > top - tf, lambda y, _: abs(y) > side - tw
    if kind == "tee":
        return y, [-top, top - tf, top], lambda _, z: z > top - tf, lambda y, _: abs(y) < tw / 2
    if kind == "i":
        return y, z, lambda _, z: abs(z) > top - tf, lambda y, _: abs(y) < tw / 2
    y = [-side, -side + tw, side]
    if kind == "angle":
        return y, [-top, -top + tf, top], lambda _, z: z < -top + tf, lambda y, _: y < -side + tw
    return y, z, lambda _, z: abs(z) > top - tf, lambda y, _: y < -side + tw


def lines(cuts: list[float], size: float, thin: float) -> np.ndarray:
    """Cells between cuts: two through a wall, else of about a size."""
    parts = [
        np.linspace(
            a, b, (2 if abs(b - a - thin) < 1e-9 else max(1, int(np.ceil((b - a) / size)))) + 1
        )[:-1]
        for a, b in pairwise(cuts)
    ]
    return np.concatenate([*parts, cuts[-1:]])


def solid(
    kind: str, d: dict[str, float], walls: dict[str, dict[str, float]], along: float = 0.018
) -> calculix.Solid:
    """A profile or panel of quadratic bricks of a length along x, whose materials lie along x and
    across each wall.
    """
    y_cuts, z_cuts, flange, web = section(kind, d)
    size = max(d["h"], d["b"]) / (20 if kind == "panel" else 6)
    x = np.linspace(0, d["L"], int(np.ceil(d["L"] / along)) + 1)
    materials = {
        wall: calculix.orthotropic(wall, [of[name] for name in _NINE], of["rho"], axes)
        for (wall, of), axes in zip(walls.items(), ("1,0,0,0,1,0", "1,0,0,0,0,1"), strict=True)
    }
    return calculix.solid(
        (x, lines(y_cuts, size, d["tw"]), lines(z_cuts, size, d["tf"])),
        lambda _x, y, z: "flange" if flange(y, z) else "web" if web(y, z) else None,
        materials,
    )


def structures_solids(*kinds: str) -> None:
    """Joints of walls of unlike thickness against CalculiX's solids: 20 modes by shells alone and
    with joints.
    """
    columns = ("shells rms:.2f", "worst:.2f", "with joints rms:.2f", "worst:.2f", "mean:+.2f")
    table = Table(
        "20 modes against solids, %", "body:8", "mm, length, height, width, walls:32", *columns
    )
    for kind, *sizes in CASES:
        if kinds and kind not in kinds:
            continue
        d = dict(zip(("L", "h", "b", "tf", "tw"), (size / 1000 for size in sizes), strict=True))
        truth = {"kind": kind, "true_dims": d, "walls": {"flange": WALL, "web": WALL}}
        exact = calculix.modes(solid(kind, d, truth["walls"]), 26)[0][6:]
        alone, joined = (
            100 * (frequencies(body(truth, 6, on), len(exact)) / exact - 1) for on in (False, True)
        )
        table.row(kind, sizes, *rms_and_worst(alone), *rms_and_worst(joined), joined.mean())


_TOLERANCES = {"L": 5e-4, "h": 2e-3, "b": 2e-3, "tf": 0.015, "tw": 0.015}
_NOMINAL = {"E1": 23e9, "E2": 8.5e9, "G12": 3.0e9, "nu12": 0.27, "rho": 1850.0}
# length, height, width, thickness of flange or plate and of web or rib, m; each is drawn within a
# fifth of these
_SIZES = {
    "i": (1.2, 0.11, 0.07, 0.007, 0.006),
    "box": (1.4, 0.1, 0.06, 0.006, 0.005),
    "channel": (0.9, 0.1, 0.05, 0.006, 0.005),
    "angle": (0.7, 0.07, 0.06, 0.005, 0.005),
    "tee": (0.9, 0.08, 0.09, 0.008, 0.006),
    "panel": (0.9, 0.05, 0.45, 0.006, 0.007),
}
_STATIONS, _LINES, _MODES, _NOISE = 9, 1600, 40, 0.01
_IN_BAND = 17


def rows(kind: str, d: dict[str, float]) -> list[tuple[float, float, int]]:
    """Rows of points along outer faces: y, z and the outward direction, in fields of a test that
    sees bending and torsion.
    """
    side, top, half = d["b"] / 2, d["h"] / 2, d["tw"] / 2
    rib = -d["b"] / 4
    return {
        "i": [(-0.8 * side, top, 3), (0.8 * side, top, 3), (half, -top / 2, 2), (half, top / 2, 2)],
        "box": [
            (-0.6 * side, top, 3),
            (0.6 * side, top, 3),
            (side, -top / 2, 2),
            (side, top / 2, 2),
        ],
        "channel": [
            (-0.3 * side, top, 3),
            (0.8 * side, top, 3),
            (-side, -top / 2, -2),
            (-side, top / 2, -2),
        ],
        "angle": [
            (-0.2 * side, -top, -3),
            (0.8 * side, -top, -3),
            (-side, -0.2 * top, -2),
            (-side, 0.8 * top, -2),
        ],
        "tee": [(-0.8 * side, top, 3), (0.8 * side, top, 3), (half, -0.8 * top, 2), (half, 0.0, 2)],
        "panel": [
            (-side, top, 3),
            (rib, top, 3),
            (0.0, top, 3),
            (0.6 * side, top, 3),
            (rib - half, -0.6 * top, -2),
        ],
    }[kind]


def measured(kind: str, seed: int, *, clamped: bool) -> tuple[dict, FrfSet]:
    """The truth of a drawn body, as the stored ones state theirs, and its FRFs of a roving hammer
    and two accelerometers.
    """
    rng = np.random.default_rng(seed)
    dims = {n: v * rng.uniform(0.8, 1.2) for n, v in zip(_TOLERANCES, _SIZES[kind], strict=True)}
    d = {
        name: value * (1 + _TOLERANCES[name] * rng.standard_normal())
        for name, value in dims.items()
    }
    common = {
        name: _NOMINAL[name] * np.exp(0.12 * rng.standard_normal()) for name in ("E1", "E2", "G12")
    }
    walls = {}
    for wall in ("flange", "web"):
        w = {name: value * np.exp(0.1 * rng.standard_normal()) for name, value in common.items()}
        rest = {
            "E3": 0.9 * w["E2"],
            "nu13": 0.3,
            "nu23": 0.35,
            "G13": 0.9 * w["G12"],
            "G23": 0.75 * w["G12"],
        }
        walls[wall] = w | rest | {"nu12": rng.normal(0.26, 0.01), "rho": _NOMINAL["rho"]}
    body = solid(kind, d, walls, 0.025)
    stations = np.linspace(0.12 if clamped else 0.02, 0.98, _STATIONS) * d["L"]
    wanted = [((x, y, z), axis) for x in stations for y, z, axis in rows(kind, d)]
    nodes = [
        int(np.argmin(np.sum((body.places - place) ** 2 * (1, 4, 4), axis=1)))
        for place, _ in wanted
    ]
    hz, motions = calculix.modes(body, _MODES, [node + 1 for node in nodes], clamped=clamped)
    hz[: 0 if clamped else 6] = 0.0
    axes = [axis for _, axis in wanted]
    # an array (p, n)
    shapes = np.array([np.sign(a) * motions[:, i, abs(a) - 1] for i, a in enumerate(axes)])
    a0, a1 = rng.uniform(3, 10), rng.uniform(4e-6, 12e-6)
    lines = np.arange(1, _LINES + 1) * 1.02 * hz[hz > 0][_IN_BAND - 1] / _LINES
    omega, own = 2 * np.pi * lines, 2 * np.pi * hz[:, None]
    modal = -(omega**2) / (own**2 - omega**2 + 1j * omega * (a0 + a1 * own**2))
    fixed = (
        len(nodes) - 1 if clamped else 0,
        next(i for i in range(len(nodes) // 2, len(nodes)) if abs(axes[i]) == 2),
    )
    exact = np.concatenate([(shapes[at] * shapes) @ modal for at in fixed])
    values = add_noise(exact, _NOISE, 1.0, rng)
    dofs = [Dof(number, axis) for number, axis in enumerate(axes, start=1)]
    responses = tuple(dofs[at] for at in fixed for _ in dofs)
    points = [
        {"number": n, "xyz": body.places[node].tolist()} for n, node in enumerate(nodes, start=1)
    ]
    truth = {"kind": kind, "bc": "clamped" if clamped else "free", "walls": walls, "points": points}
    truth |= {"stated": {"dims": dims, "material": _NOMINAL}, "rayleigh": {"a0": a0, "a1": a1}}
    return truth, FrfSet(lines, values, responses, tuple(dofs) * 2)


def structures_drawn(first_seed: int = 4100, draws: int = 1, *kinds: str) -> None:
    """Profiles drawn at random as solids by CalculiX, every other one clamped, updated by `{}`."""
    offs: list[Off] = []
    for seed in range(first_seed, first_seed + draws):
        for number, kind in enumerate(kinds or _SIZES):
            clamped = (seed + number) % 2 == 1
            truth, frfs = measured(kind, seed, clamped=clamped)
            offs += update_printed(f"{kind} {seed} {truth['bc']}", *stated(truth, 4, frfs))
    print_coverage(f"{sum(abs(off.z) > 3 for off in offs)} beyond 3 sd", {"all constants": offs})


def panel_decks(*kinds: str) -> None:
    """Panels with a cut-out, curved, tapered as decks of two elements and two sizes each, updated
    with exact inputs.
    """
    offs: list[Off] = []
    for kind in kinds or panels.KINDS:
        modes, points = panels.measured(kind)
        true = {f"skin.{name}": value for name, value in panels.TRUTH.items()}
        for element, along, across in (
            ("quad4", 12, 8),
            ("quad4", 24, 16),
            ("quad8", 6, 4),
            ("quad8", 12, 8),
        ):
            body = panels.deck(kind, along, across, element)
            measurement = Measurement(None, points, modes, inputs=Inputs.exact())
            offs += update_printed(f"{kind}, {along} × {across} {element}", body, measurement, true)
    print_coverage(
        f"{sum(abs(off.z) > 2 for off in offs)} beyond 2 sd", {"identifiable constants": offs}
    )
