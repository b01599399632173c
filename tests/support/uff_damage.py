"""Damaged UFF files, and the verdict on each.

A variant passes when the file is refused, when a dataset is refused or its change noted, when it
reads equal, or when the damage made another sound number and exactly that number is read (a digit
flipped in an ordinate: nothing in the format could detect). Anything else is a silent change, and
there must be none.
"""

import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from modalbase.formats.uff import (
    Axis,
    DatasetReport,
    FileHeader,
    Frf,
    Function,
    GridPoint,
    Limits,
    ModeShape,
    UffError,
    read_file,
)
from modalbase.formats.uff.write import encode

VERDICTS = (
    "file refused",
    "dataset refused or noted",
    "equal",
    "reads what is written",
    "SILENT CHANGE",
)
MANY = 1000  # changed values, where the contents are not alike at all
FLOODS: dict[str, Callable[[], bytes]] = {
    "20 MB of newlines": lambda: b"\n" * 20_000_000,
    "20 MB of newlines in a dataset": lambda: (
        b"    -1\n    15\n" + b"\n" * 20_000_000 + b"    -1\n"
    ),
    "28 MB of -1 lines": lambda: b"    -1\n" * 4_000_000,
    "28 MB of odd -1 lines in a dataset": lambda: (
        b"    -1\n    58\n" + b"  -1\n" * 5_600_000 + b"    -1\n"
    ),
    "28 MB of empty datasets": lambda: b"    -1\n   999\n    -1\n" * 1_330_000,
    "20 MB without a line end": lambda: b"    -1\n    58\n" + b"1" * 20_000_000,
}
_IDS = ("beam", "run 1", "21-Nov-15 09:00:00", "NONE", "NONE")


def run(
    count: int, seed: int, folder: Path
) -> tuple[dict[str, Counter[str]], list[tuple[str, str, bytes]]]:
    """Verdicts by damage, and the silent changes."""
    rng, path, files = np.random.default_rng(seed), folder / "variant.uff", originals()
    sound: dict[str, Reading] = {}
    for name, data in files.items():
        path.write_bytes(data)
        sound[name] = load(path)
    table: dict[str, Counter[str]] = {kind: Counter() for kind in DAMAGES}
    silent, kinds = [], list(DAMAGES)
    for _ in range(count):
        name = list(files)[rng.integers(0, len(files))]
        kind = str(rng.choice(kinds, p=[DAMAGES[each][1] for each in kinds]))
        data = DAMAGES[kind][0](files[name], rng)
        path.write_bytes(data)
        verdict = _verdict(sound[name], path, kind)
        table[kind][verdict] += 1
        if verdict == VERDICTS[4]:
            silent.append((name, kind, data))
    return table, silent


def _verdict(sound: "Reading", path: Path, kind: str) -> str:
    try:
        return judge(sound, load(path), kind)
    except UffError:
        return VERDICTS[0]


# --- sound files --------------------------------------------------------------------------------------------------------


def originals() -> dict[str, bytes]:
    """The sound files: text and binary, single and double, even and uneven, LF and CRLF."""
    files = {}
    for single in (False, True):
        for even in (True, False):
            for binary in (False, True):
                name = (
                    f"{'binary' if binary else 'text'} {'single' if single else 'double'}"
                    f" {'even' if even else 'uneven'}"
                )
                points = "15" if single else "2411"
                files[name] = b"".join(
                    encode(_sample(single=single, even=even), binary=binary, points=points)
                )
    files["text double even CRLF"] = files["text double even"].replace(b"\n", b"\r\n")
    return files


def _sample(
    *, single: bool, even: bool
) -> list[FileHeader | GridPoint | Frf | Function | ModeShape]:
    """Contents of a small campaign."""
    rng, lines = np.random.default_rng(7), 47
    axis = (
        Axis(0.5, 0.5, lines)
        if even
        else Axis(0.5, 0.0, lines, np.cumsum(rng.integers(1, 9, lines)) * 0.25)
    )
    points = [
        GridPoint(i + 1, (float(x), float(y), 0.005))
        for i, (x, y) in enumerate(rng.uniform(0, 0.5, (5, 2)))
    ]
    frfs = []
    for point in points:
        values = rng.standard_normal(lines) * 10 ** rng.uniform(
            -4, 3, lines
        ) + 1j * rng.standard_normal(lines)
        values = values.astype(np.complex64) if single else values
        frfs.append(
            Frf(
                0,
                f"FRF {point.number}Z/1Z",
                _IDS,
                point.number,
                3,
                1,
                -3,
                "accelerance",
                axis,
                values,
            )
        )
    coherence = Function(
        0, "coherence", _IDS, 6, 2, 3, 1, -3, axis, "Hz", rng.uniform(0, 1, lines), ""
    )
    shape, labels = rng.standard_normal((5, 3)) + 1j * rng.standard_normal((5, 3)), np.arange(1, 6)
    modes = [
        ModeShape(0, "mode", 1, 25.63, 0.02, labels, shape, "complex"),
        ModeShape(0, "mode", 2, 160.04, 0.01, labels, shape.real.astype(complex), "normal"),
    ]
    return [
        FileHeader(0, "BEAM", "damage", "modalbase", "21-Nov-15"),
        *points,
        *frfs,
        coherence,
        *modes,
    ]


# --- damages ------------------------------------------------------------------------------------------------------------


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    """The file ends early."""
    return data[: rng.integers(0, len(data))]


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    """One byte becomes another: any other, a bit of it, or a character that numbers are made of."""
    place = int(rng.integers(0, len(data)))
    bit = data[place] ^ (1 << int(rng.integers(0, 8)))
    new = (int(rng.integers(0, 256)), bit, b"0123456789+-.eED \n"[rng.integers(0, 18)])
    return data[:place] + bytes([new[rng.integers(0, 3)]]) + data[place + 1 :]


def _stray_tag(data: bytes, rng: np.random.Generator) -> bytes:
    """One or two delimiter lines too many."""
    starts = [0, *(match.end() for match in re.finditer(rb"\n", data))]
    place = (
        starts[rng.integers(0, len(starts))]
        if rng.random() < 0.8
        else int(rng.integers(0, len(data)))
    )
    return data[:place] + b"    -1\n" * int(rng.integers(1, 3)) + data[place:]


def _recount(data: bytes, rng: np.random.Generator, new: Callable[[int], int]) -> bytes:
    """Another number of points, or of binary bytes, in one set 58."""
    forms = list(
        re.finditer(rb"(?<=\n)( {9}[2456])( {6,8}[1-9][0-9]{1,3})( {9}[01])(?=[^\n]{39})", data)
    )
    heads = list(re.finditer(rb"(    58b {5}1 {5}2 {10}11)([ 0-9]{12})", data))
    found = heads if heads and rng.random() < 0.5 else forms
    match = found[rng.integers(0, len(found))]
    width = len(match[2])
    text = str(new(int(match[2])))[:width].rjust(width).encode()
    return data[: match.start(2)] + text + data[match.end(2) :]


def _inflated(data: bytes, rng: np.random.Generator) -> bytes:
    """A count that is too large, up to absurd."""
    return _recount(
        data,
        rng,
        lambda count: int(count * rng.choice([2, 10, 1e4, 1e7])) + int(rng.integers(1, 99)),
    )


def _not_finite(data: bytes, rng: np.random.Generator) -> bytes:
    """An ordinate that is NaN or infinite."""
    text = [b"NaN", b"Inf", b"-Infinity", b"1.0E+999", b"**********"][rng.integers(0, 5)]
    heads = list(re.finditer(rb"    58b[ 0-9]{36}", data))
    if not heads:
        numbers = list(re.finditer(rb" *-?[0-9]\.[0-9]+[eE][+-][0-9]+", data))
        match = numbers[rng.integers(0, len(numbers))]
        width = match.end() - match.start()
        return data[: match.start()] + text.rjust(width)[:width] + data[match.end() :]
    head = heads[rng.integers(0, len(heads))]
    end = data.index(b"    -1\n", head.end())
    start = end - int(head[0][31:43])
    item = b"\x00\x00\xc0\x7f" if rng.random() < 0.5 else b"\x00\x00\x80\xff"
    # double
    if b"         4" in data[head.start() : start] or b"         6" in data[head.start() : start]:
        item = b"\x00\x00\x00\x00\x00\x00" + (b"\xf8\x7f" if rng.random() < 0.5 else b"\xf0\xff")
    place = start + len(item) * int(rng.integers(0, (end - start) // len(item)))
    return data[:place] + item + data[place + len(item) :]


DAMAGES: dict[str, tuple[Callable[[bytes, np.random.Generator], bytes], float]] = {
    "cut": (_cut, 0.2),
    "byte flip": (_flip, 0.4),
    "stray tag": (_stray_tag, 0.15),
    "inflated count": (_inflated, 0.1),
    "negative count": (lambda data, rng: _recount(data, rng, lambda count: -count), 0.05),
    "NaN or Inf": (_not_finite, 0.1),
}

# --- verdicts -----------------------------------------------------------------------------------------------------------


@dataclass
class Reading:
    """Contents and reports of a file, by dataset."""

    contents: list[list[object]]
    reports: list[DatasetReport]


def load(path: Path) -> Reading:
    """Read a file to its end."""
    reading, current = Reading([], []), list[object]()
    for item in read_file(path):
        if isinstance(item, DatasetReport):
            reading.contents.append(current)
            reading.reports.append(item)
            current = []
        else:
            current.append(item)
    return reading


def judge(sound: Reading, damaged: Reading, kind: str) -> str:
    """The verdict on a file that could be read."""
    n = len(damaged.reports)
    if n > len(sound.reports) or (n < len(sound.reports) and kind != "cut"):
        # Datasets ran together or fell apart: one must be refused, and what is read must be
        # unchanged.
        read = [
            c
            for c, report in zip(damaged.contents, damaged.reports, strict=True)
            if report.outcome == "read"
        ]
        unchanged = all(any(_changes(one, other) == 0 for one in sound.contents) for other in read)
        refused = any(report.outcome == "refused" for report in damaged.reports)
        return VERDICTS[1] if unchanged and refused else VERDICTS[4]
    verdict = VERDICTS[2]
    for i in range(n):
        was, now = sound.reports[i], damaged.reports[i]
        if not (differing := _changes(sound.contents[i], damaged.contents[i])):
            continue
        if now.outcome != "read" or set(now.notes) - set(was.notes):
            verdict = VERDICTS[1]
        elif differing > 1:
            return VERDICTS[4]
        elif verdict == VERDICTS[2]:
            verdict = VERDICTS[3]
    return verdict


def _changes(sound: list[object], damaged: list[object]) -> int:
    """How many values differ; one where a type alone changed: what was an FRF is reported as what
    it says it is now.
    """
    if len(sound) != len(damaged):
        return MANY
    count = 0
    for a, b in zip(sound, damaged, strict=True):
        one, other = list(_leaves(a)), list(_leaves(b))
        if type(a) is not type(b):
            count += 1
        else:
            count += (
                MANY
                if len(one) != len(other)
                else sum(x != y for x, y in zip(one, other, strict=True))
            )
    return count


def _leaves(content: object) -> Iterator[str]:
    """The values of a content, array by element; what two fields state together counts once."""
    for field in fields(content):  # type: ignore[arg-type]
        value = getattr(content, field.name)
        if field.name == "dataset" or (field.name == "label" and hasattr(content, "id_lines")):
            continue
        if (
            isinstance(content, ModeShape)
            and field.name == "damping_ratio"
            and content.kind != "normal"
        ):
            continue  # of a complex mode it changes with the frequency
        if isinstance(value, Axis):
            value = (value.start, value.step) if value.values is None else value.values
        if isinstance(value, np.ndarray) and value.dtype.kind == "c":
            value = np.stack((value.real, value.imag))
        yield from map(repr, np.asarray(value).ravel().tolist())


# --- floods -------------------------------------------------------------------------------------------------------------

_FLOOD = """
import os, re, sys
from pathlib import Path
from modalbase.formats.uff import DatasetReport, Limits, UffError, read_file
def peak():  # of this process alone: ru_maxrss begins with its parent's
    return int(re.search(r"VmHWM:\\s*(\\d+)", Path("/proc/self/status").read_text())[1])
def read(path, most):
    before = peak()
    try:
        said = [f"{r.outcome}: {r.reason}" for r in read_file(path, Limits(datasets=most)) if isinstance(r, DatasetReport)]
        outcome = "; ".join(said)
    except UffError as error:
        outcome = f"file refused: {error}"
    print(f"{(peak() - before) / 1024:.1f}|{outcome}", flush=True)
for path in sys.argv[2:]:
    if not (child := os.fork()):
        read(Path(path), int(sys.argv[1]))
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        sys.exit(f"reading {path} ended badly")
"""


def flood(
    files: dict[str, bytes], folder: Path, most: int = Limits().datasets
) -> dict[str, tuple[float, str]]:
    """Of each file, read in a process of its own that takes `most` datasets: MiB that it adds, what
    became of it.
    """
    paths = [folder / f"{number}.uff" for number in range(len(files))]
    for path, data in zip(paths, files.values(), strict=True):
        path.write_bytes(data)
    command = [sys.executable, "-c", _FLOOD, str(most), *map(str, paths)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    said = (line.split("|", 1) for line in done.stdout.splitlines())
    return {
        name: (float(memory), outcome) for name, (memory, outcome) in zip(files, said, strict=True)
    }
