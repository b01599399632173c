"""Blocks of code of the documents, and what a reader of each page has at hand before its blocks
run.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Self

import numpy as np

from fecore.arrays import FloatArray
from tests.support.places import ROOT
from tests.support.wind import wind

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
_BLOCK = re.compile(r"^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes:
        page: its file, relative to the project.
        line: of its first line, from 1.
        language: what stands behind the fence; `text` is what nothing runs.
        text: what is in it.
    """

    page: str
    line: int
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def blocks() -> list[Block]:
    """All blocks of all pages, in order."""
    return [
        Block(
            str(page.relative_to(ROOT)),
            text.count("\n", 0, found.start()) + 2,
            found["language"],
            found["text"],
        )
        for page in PAGES
        for text in [page.read_text(encoding="utf-8")]
        for found in _BLOCK.finditer(text)
    ]


def _coupon() -> dict[str, Any]:
    strain = np.linspace(0, 6e-3, 61)
    curve = "Time,Load,Strain 1\ns,kN,%\n" + "".join(
        f"{i},{0.04 * i:.3f},{0.02 * i:.3f}\n" for i in range(61)
    )
    return {
        "force_n": 40e9 * strain * 50e-6,
        "strain": strain,
        "lateral": -0.15 * strain,
        "data": curve.encode(),
    }


def _measured() -> dict[str, Any]:
    from tests.support.beams import PAPER_HZ, PAPER_ZETA, paper_frfs

    return {"frfs": paper_frfs(0.01, lines=400), "f_hz": PAPER_HZ, "zeta": PAPER_ZETA}


def _hits() -> dict[str, Any]:
    from tests.support.hammer import campaign

    _, _, simulated = campaign(np.random.default_rng(3), "cantilever", 2, 3, 0.0)
    force, response = np.random.default_rng(4).standard_normal((2, 3, 256))
    series = [
        {"name": "hammer", "data": force, "fs": 2048, "unit_str": "N"},
        {"name": "acc", "data": response, "fs": 2048, "unit_str": "g"},
    ]
    return {"hits": [one.hit for one in simulated], "series": series}


def _months() -> dict[str, Any]:
    rng, start = np.random.default_rng(5), datetime(2026, 1, 15, tzinfo=UTC)
    dates = [start + timedelta(days=30.4 * i) for i in range(20)]
    t = 20 + 3 * rng.standard_normal(20)
    return {
        "dates": dates,
        "labels": [f"{date:%B %Y}" for date in dates],
        "now": dates[-1],
        "t": t,
        "ex": 31e9 * (1 + 0.004 * rng.standard_normal(20)),
        "ex_sd": np.full(20, 1e8),
        "zeta": 0.02 * (1 + 0.05 * rng.standard_normal(20)),
        "zeta_sd": np.full(20, 1e-3),
    }


class _Chain:
    """A computation of three steps, for the block that shows how a long one is written."""

    def __init__(self, step: int) -> None:
        self.step, self.steps = step, 3

    @classmethod
    def start(cls, _: Any) -> Self:
        return cls(0)

    def advance(self) -> None:
        self.step += 1

    def result(self) -> int:
        return self.step


def _long() -> dict[str, Any]:
    return {"Inputs": Any, "Reporter": Any, "Output": Any, "Chain": _Chain}


def _responses(file: str = "deck.npz", seed: int = 1, first_hz: float = 3.0) -> dict[str, Any]:
    """Five minutes of three sensors on a deck in the wind, and the file of them."""
    rng, rate = np.random.default_rng(seed), 50.0
    time = np.arange(15_000) / rate
    x = 0.05 * rng.standard_normal((3, time.size))
    for hz, shape in ((first_hz, (1.0, 0.6, -0.4)), (8.0, (0.8, -0.7, 1.0))):
        decay = np.exp(-0.1 * np.pi * hz * time[:600]) * np.cos(2 * np.pi * hz * time[:600])
        x += np.outer(shape, np.convolve(rng.standard_normal(time.size), decay)[: time.size])
    channels = {f"a_{point}": row for point, row in zip((11, 22, 33), x, strict=True)}
    np.savez(file, time_s=time, **channels)
    return {"samples": x, "rate": rate}


def _days() -> dict[str, Any]:
    """Recordings of seven nights; in the last one the first mode is 5 % lower."""
    Path("days").mkdir()
    for day in range(1, 8):
        _responses(f"days/night_{day}.npz", day, 3.0 if day < 7 else 2.85)
    return {}


def _shaken() -> dict[str, Any]:
    """A minute of three sensors and two shakers, and the file of them; files of three steady sines
    each of the first shaker.
    """
    rng, rate = np.random.default_rng(1), 50.0
    time = np.arange(3000) / rate
    Path("steps").mkdir()

    def written(file: str, loads: FloatArray) -> FloatArray:
        x = np.zeros((3, 3600))
        for hz, shape in ((3.0, (1.0, 0.6, -0.4)), (8.0, (0.8, -0.7, 1.0))):
            t = np.arange(600) / rate
            decay = np.exp(-0.1 * np.pi * hz * t) * np.sin(2 * np.pi * hz * t)
            answer = np.diff(decay, 2, append=0, prepend=0)
            modal = np.asarray(shape[: len(loads)]) @ loads
            x += np.outer(shape, np.convolve(modal, answer)[:3600])
        recording = np.concatenate([x, loads])[:, 600:]
        names = [f"a_{point}" for point in (11, 22, 33)] + [f"f_{point}" for point in (11, 22)]
        np.savez(file, time_s=time, **dict(zip(names, recording, strict=False)))
        return recording

    for number, hz in enumerate(np.arange(2.0, 10, 0.25).reshape(4, 8).T):
        sines = np.sin(2 * np.pi * np.outer(hz, np.arange(3600) / rate)).sum(axis=0)
        written(f"steps/{number}.npz", sines[None])
    return {"recording": written("shakers.npz", rng.standard_normal((2, 3600))), "rate": rate}


def _hour() -> dict[str, Any]:
    """The file of a recording that states its time, with two slow channels."""
    slow = {"anemometer": np.array([3.0, 5.0]), "pt100": np.full(60, 0.135)}
    Path("hour.npz").write_bytes(wind(1, start_unix_s=np.array(1_772_443_800), **slow))
    return {}


def _profile() -> dict[str, Any]:
    from tests.support.profiles import i_profile

    Path("i.uff").write_bytes(i_profile())
    return {}


def _bracket() -> dict[str, Any]:
    from tests.support.profiles import deck, measured

    Path("angle.uff").write_bytes(measured())
    Path("bracket.inp").write_bytes(deck(1e-3))
    return {}


AT_HAND: dict[str, Callable[[], dict[str, Any]]] = {
    "docs/ambient.md": _responses,
    "docs/coupons.md": _coupon,
    "docs/hammer.md": _hits,
    "docs/i-profile.md": _profile,
    "docs/loads.md": _shaken,
    "docs/modes.md": _measured,
    "docs/jobs.md": _long,
    "docs/monitoring-charts.md": _months,
    "docs/own-model.md": _bracket,
    "docs/recordings-that-come.md": _hour,
    "docs/watched-footbridge.md": _days,
}
"""Names that a page's Python takes as given, such as the arrays of a reader's own measurement."""
