"""Raw hammer hits: what the judgement finds, and what pyFRF's default limits find of the same hits.

Simulated campaigns (`benchmarks.hammer`: other specimens, tips, sensors, noise in each; a third of the hits has a fault),
and the sets of another simulator where they lie beside the project (`MODALBASE_HITS` names their folder).
The arguments are the number of campaigns and the seed. The same campaigns are judged once more by the first three and the first
two hits of each point alone.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.hammer import campaign
from fecore.frf import Dof
from fecore.signal import Block, Hit, Processing, by_point, process

POINTS, HITS = 8, 5
FEWER = (3, 2)
SETS = ("hits-cantilever", "hits-free-window", "hits-plate-one-point")
NAMED = {"clip_force": "overload", "clip_response": "overload", "off_place": "place"}

try:
    from pyFRF import FRF
except ImportError:  # an optional peer
    FRF = None

Positions = dict[int, tuple[float, float, float]]
Tally = dict[str, Counter[str | None]]


def main(campaigns: int = 12, seed: int = 20260) -> None:
    """Print the tables."""
    rng = np.random.default_rng(seed)
    tally, fewer = _new_tally(), {count: _new_tally() for count in FEWER}
    for number in range(campaigns):
        _, places, simulated = campaign(rng, ("clamped", "free", "plate")[number % 3], POINTS, HITS, 1 / 3)
        positions = {label: (*place, 0.0) for label, place in places.items()}
        _count(tally, [s.hit for s in simulated], [s.fault for s in simulated], positions)
        for count, own in fewer.items():
            some = [s for s in simulated if s.hit.number <= count]
            _count(own, [s.hit for s in some], [s.fault for s in some], positions, with_peer=False)
    _table(f"{campaigns} simulated campaigns", tally)
    _by_hits({HITS: tally, **fewer})
    folder = Path(os.environ.get("MODALBASE_HITS", Path(__file__).parents[2] / "shared" / "blind-open"))
    for name in SETS:
        if (folder / name / "truth.json").is_file():
            tally = _new_tally()
            _count(tally, *read_set(folder / name))
            _table(name, tally)


def read_set(folder: Path) -> tuple[list[Hit], list[str | None], Positions]:
    """Hits of a set of another simulator, in SI, their faults, and where the points lie."""
    data, truth = np.load(folder / "hits.npz"), json.loads((folder / "truth.json").read_text())
    known = truth["instruments"]
    rate, sensor = known["window_rate_per_s"], Dof(known["sensor_point"], 3)
    hits = [
        Hit(
            Block(Dof(int(point), 3), "force", force / known["force_V_per_N"], rate),
            (Block(sensor, "acceleration", response / known["acceleration_V_per_m_s2"], rate),),
            float(known["fs_hz"]),
            int(number),
        )
        for force, response, point, number in zip(
            data["force"].astype(float), data["acceleration"].astype(float), data["point"], data["hit"], strict=True
        )
    ]
    positions = {label: (place[0], place[1], 0.0) for label, place in enumerate(truth["points"], 1)}
    return hits, [record["fault"] for record in truth["records"]], positions


def _new_tally() -> Tally:
    return {"hits": Counter(), "found": Counter(), "named": Counter(), "pyFRF": Counter()}


def _count(
    tally: Tally, hits: Sequence[Hit], faults: Sequence[str | None], positions: Positions, *, with_peer: bool = True
) -> None:
    try:
        verdicts = process(by_point(hits), Processing(positions=positions)).verdicts
    except Exception as error:  # noqa: BLE001 - a set without a good hit is a result
        print(f"  {error}")
        verdicts = ()
    for i, (hit, fault) in enumerate(zip(hits, faults, strict=True)):
        tally["hits"][fault] += 1
        named = {f.criterion for f in verdicts[i].faults} if verdicts else {"overload"}
        tally["found"][fault] += bool(named)
        tally["named"][fault] += NAMED.get(fault, fault) in named if fault else bool(named)
        if FRF is not None and with_peer:
            peer = FRF(int(hit.sample_rate_hz), exc_type="f", resp_type="a", fft_len=hit.samples)
            tally["pyFRF"][fault] += not peer.is_data_ok(hit.force.samples, hit.responses[0].samples)


def _table(name: str, tally: Tally) -> None:
    print(f"\n{name}\n{'fault':16}{'hits':>6}{'thrown away':>14}{'under its name':>16}{'pyFRF throws':>15}")
    for fault in sorted(tally["hits"], key=str):
        n = tally["hits"][fault]
        peer = f"{tally['pyFRF'][fault] / n:.1%}" if FRF is not None else "not there"
        shares = (tally["found"][fault] / n, tally["named"][fault] / n)
        print(f"{fault or 'none: good':16}{n:6}{shares[0]:14.1%}{shares[1] if fault else float('nan'):16.1%}{peer:>15}")


def _by_hits(tallies: dict[int, Tally]) -> None:
    """Found of the hits with each fault, by how many hits a point has."""
    print("\n" + f"{'hits a point':16}" + "".join(f"{count:>20}" for count in tallies))
    for fault in sorted(next(iter(tallies.values()))["hits"], key=str):
        shares = [(tally["found"][fault], tally["hits"][fault]) for tally in tallies.values()]
        columns = "".join(f"{f'{found} of {n}':>13}{found / max(n, 1):7.1%}" for found, n in shares)
        print(f"{fault or 'good: thrown':16}{columns}")
