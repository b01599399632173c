"""Golden documents: what a user sees, kept as text, so that a change of the code shows the lines
that it changes.

`check` compares a document with `tests/golden/data/NAME.txt`, in the form of `golden_text`. With
MODALBASE_GOLDEN=write it writes what is different anew and prints it: `pytest tests/golden -s`,
with `-k` for some. Compared are members, lengths and the order of lists exactly, sentences but for
the numbers in them, and numbers to half of their last digit kept and, beside it, to `CLOSE` of
their size or `SHARE` of their standard deviation, whichever is wider. `golden_parts` says what is
left out.
"""

import json
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from tests.support.golden_parts import freeze
from tests.support.golden_text import (
    columns,
    empty,
    members,
    places,
    read,
    shortened,
    tree,
    written,
)
from tests.support.places import ROOT

DATA = ROOT / "tests" / "golden" / "data"
WRITE = "MODALBASE_GOLDEN"
MEMBERS, SENTENCES = DATA / "members.txt", DATA / "sentences.txt"
OF_RESULTS = {"update", "joint", "identification", "processing", "plans", "coupons", "monitor"}
OF_ALL = "document"
WITH_MEMBERS = {"update", "joint", "identification"}
"""First words of the names of documents whose sentences are in `SENTENCES`, and of those whose
members are in `MEMBERS`.
"""
CLOSE, SHARE = 1e-9, 1e-6
DIGITS = tuple(
    (re.compile(pattern), digits)
    for pattern, digits in (
        (r"(standard_deviation|_sd(_hz)?|provenance)$|/standard_deviations/", 3),
        (r"_hz$", 5),
        (r"", 4),
    )
)
"""How many digits of a number are kept, where its standard deviation asks for no more."""
ORDER_ONE = re.compile(
    r"/(share|correlation|mac_matrix|mac|missed|missed_by|phase_collinearity)\b(?!.*_hz)"
)
MATRIX = re.compile(r"/(correlation|mac_matrix)/\d+/\d+$")
"""Members of which three decimals are kept, and of those in matrices two."""
_INDEX = re.compile(r"/\d+(?=/|$)")
DEVIATIONS = {
    "frequency_hz": "frequency_sd_hz",
    "damping_ratio": "damping_sd",
    "measured_damping": "measured_damping_sd",
    "coefficients": "standard_deviations",
    **dict.fromkeys(("raw", "mean", "estimate", "interval_95"), "standard_deviation"),
}
"""Members that are known to a standard deviation, and the member of the same object that states
it.
"""

LOOSER: tuple[tuple[re.Pattern[str], float, float, float], ...] = tuple(
    (re.compile(pattern), relative, absolute, share)
    for pattern, relative, absolute, share in (
        # Second derivatives of a misfit where a search ended; what is printed of them has two
        # digits.
        (r"(standard_deviation|_sd(_hz)?)$|/standard_deviations/", 3e-4, 0.0, 3e-5),
        # Numbers of order one, made of all others.
        (
            r"/(share|correlation|mac_matrix|[a-z]*sac|frac|cs\w+_mean|coverage_95|missed(_by)?|phase_collinearity)\b",
            0,
            5e-5,
            0,
        ),
        (r"/error_percent$", 0.0, 1e-6, 0.0),
        # Where the search for damping ended, a thousandth of a standard deviation from the minimum.
        (r"/(optima|coefficients|curve|predicted_damping)\b", 1e-5, 0.0, 1e-4),
        # a ten-thousandth of a degree at 1 kHz; none is known better
        (r"/channel_delay_s$", 3e-4, 1e-10, 0.0),
        (r"/(parameters|own)/", 5e-6, 0.0, 1e-4),
        (r"/(bic|discrepancy/\w+)$", 2e-6, 0.0, 0.0),
        (r"_hz\b|/(measured_damping|damping_ratio)$", 5e-7, 0.0, 0.0),
        (r"/refused_poles/", 1e-4, 0.0, 0.0),
        (r"/(drift|model_error|noise_ratio|memory_lines)$", 1e-6, 0.0, 0.0),
        # A few poles beside the modes of these hits are in the series or not by the last bits.
        (r"^update-hits-free-window/", 2e-2, 0.0, 1.0),
        (
            r"^update-hits-free-window/.*/(share|correlation|mac_matrix|missed|error_percent)\b",
            0.0,
            5e-2,
            0.0,
        ),
        (
            r"^update-hits-free-window/.*(_sd(_hz)?$|standard_deviations?\b|discrepancy|memory_lines|refused)",
            0.6,
            0.0,
            0.0,
        ),
        # Made of estimates and their standard deviations.
        (r"/(z|predictive_p|information_nats)$|^plans", 2e-6, 1e-9, 0.0),
        (r"^exports-computed/|/deck/", 1e-5, 0.0, 0.0),
        (r"^monitor/", 1e-4, 0.0, 0.0),
        # Drawn with five digits.
        (r"/curve/|^figures/|/figures?/", 2e-4, 1e-6, 0.0),
        # A chain takes a step or not by its last bits; some 5000 effective samples fix a standard
        # deviation to 1 %.
        (
            r"^update-paper-sampled/.*/(posterior|budget|interval_95|standard_deviation)\b",
            0.3,
            0.1,
            0.3,
        ),
        # Each place of the sensor is a body of its own: its searches end by their count.
        (r"^update-sensor-", 5e-5, 0.0, 1e-3),
        (r"^update-sensor-.*/error_percent$", 0.0, 1e-5, 0.0),
    )
)
"""Numbers that differ by more than `CLOSE` between processors: relative, absolute, and as a share
of their standard deviation. Between OpenBLAS's kernels for Nehalem and Haswell they differ by a
third of that at most.
"""


OTHER_POLES = re.compile(r"^update-hits-free-window/.*/refused_poles/(probability|reason)\b")
"""What is said of poles that are others by the last bits; how many there are and where they lie is
compared.
"""


def different(kept: Any, found: Any, place: str, sd: Any = 0.0, scale: Any = 0.0) -> Iterator[str]:
    """What is not the same in two documents in columns, each by its place.

    Args:
        kept: from the file.
        found: of now.
        place: of both: the document's name and a JSON pointer.
        sd: standard deviation of a number, of each of a list, or those of an object's members by
            name.
        scale: of the numbers of an array: its root mean square; of each of a list of arrays.
    """
    if OTHER_POLES.search(_column(place)):
        return
    if isinstance(kept, dict) and isinstance(found, dict):
        for name in [*found, *(name for name in kept if name not in found)]:
            one, other, where = kept.get(name), found.get(name), f"{place}/{name}"
            if empty(one) and empty(other):
                continue
            if empty(one) or empty(other):
                yield (
                    f"{where}: is gone, was {_short(one)}"
                    if empty(other)
                    else f"{where}: is new, {_short(other)}"
                )
            else:
                yield from different(
                    one, other, where, _deviation(found, name, sd), found.get("rms", scale)
                )
    elif isinstance(kept, list) and isinstance(found, list):
        if len(kept) != len(found):
            yield (
                f"{place}: had {len(kept)} entries, has {len(found)}: {_short(kept)},"
                f" {_short(found)}"
            )
        for i, (one, other) in enumerate(zip(kept, found, strict=False)):
            yield from different(
                one, other, f"{place}/{i}", _of(sd, i, found), _of(scale, i, found)
            )
    elif _number(kept) and _number(found) and isinstance(kept, float) | isinstance(found, float):
        unit = _unit(place, found, sd, scale)
        if abs(kept - found) > 0.51 * unit + _allowed(
            place, max(abs(kept), abs(found), _size(scale)), _size(sd)
        ):
            yield (
                f"{place}: was {kept!r}, is {found!r},"
                f" {abs(kept - found) / max(abs(kept), 1e-300):.1e} of it"
            )
    elif type(kept) is not type(found) or kept != found:
        yield f"{place}: was {_short(kept)}, is {_short(found)}"


def settled(kept: Any, found: Any, place: str, sd: Any = 0.0, scale: Any = 0.0) -> Any:
    """What is kept of a document: rounded; what differs from what was kept by no more than
    round-off stays as it was.
    """
    if isinstance(found, dict):
        before = kept if isinstance(kept, dict) else {}
        return {
            name: settled(
                before.get(name),
                each,
                f"{place}/{name}",
                _deviation(found, name, sd),
                found.get("rms", scale),
            )
            for name, each in found.items()
        }
    if (
        kept is not None
        and type(kept) is type(found)
        and not any(different(kept, found, place, sd, scale))
    ):
        return kept
    if isinstance(found, list):
        before = kept if isinstance(kept, list) and len(kept) == len(found) else [None] * len(found)
        pairs = enumerate(zip(before, found, strict=True))
        return [
            settled(a, b, f"{place}/{i}", _of(sd, i, found), _of(scale, i, found))
            for i, (a, b) in pairs
        ]
    if not isinstance(found, float) or not math.isfinite(found):
        return found
    unit = _unit(place, found, sd, scale)
    return float(f"{round(found / unit) * unit:.12g}") if unit else found


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _of(each: Any, i: int, found: list[Any]) -> Any:
    """Of a column of standard deviations or sizes that of an entry."""
    return each[i] if isinstance(each, list) and len(each) == len(found) else each


def _size(value: Any) -> float:
    return float(value) if _number(value) else 0.0


def _unit(place: str, value: float, sd: Any, scale: Any) -> float:
    """Of the last digit that is kept of a number."""
    size = max(abs(value), _size(scale))
    if not size or not math.isfinite(size):
        return 0.0
    digits = next(digits for pattern, digits in DIGITS if pattern.search(_column(place)))
    unit = 10.0 ** (math.floor(math.log10(size)) - digits + 1)
    if ORDER_ONE.search(_column(place)):
        return 1e-2 if MATRIX.search(place) else 1e-3
    known = _size(sd)
    return min(unit, 10.0 ** math.floor(math.log10(known / 5))) if known > 0 else unit


def _column(place: str) -> str:
    """A place without the numbers of entries."""
    return _INDEX.sub("", place.replace("[]", ""))


def _deviation(stated: dict[str, Any], name: str, sd: Any) -> Any:
    """The standard deviation of a member, or those of the member's own: what is stated beside it,
    or about all of them.
    """
    beside = stated.get(DEVIATIONS.get(name, ""))
    about = sd.get(name) if isinstance(sd, dict) else sd
    return about if beside is None else beside


def _allowed(place: str, size: float, sd: float) -> float:
    """The largest difference of a number that is none."""
    column = _column(place)
    rows = [(CLOSE, 0.0, SHARE), *(row[1:] for row in LOOSER if row[0].search(column))]
    return max(max(relative * size, absolute, share * sd) for relative, absolute, share in rows)


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) < 200 else f"{text[:200]}…"


def check(name: str, document: Any) -> None:
    """A document is as it is kept; or, where `WRITE` is set, it is kept as it is."""
    path, sentences, write = DATA / f"{name}.txt", set[str](), bool(os.environ.get(WRITE))
    family, found = name.partition("-")[0], columns(freeze(document))
    if family in OF_RESULTS:
        found = shortened(found, sentences)
    kept = read(path.read_text(encoding="utf-8")) if path.exists() else {}
    differences = list(different(kept, found, name))
    new = {
        SENTENCES: _added(SENTENCES, sentences, lambda text: set(text.splitlines()), _lines, write)
    }
    if family in WITH_MEMBERS:
        new[MEMBERS] = _added(MEMBERS, set(members(found, OF_ALL)), places, tree, write)
    differences += (
        f"{file.name}: has no “{entry}”"
        for file, entries in new.items()
        for entry in sorted(entries)
    )
    if write and differences:
        path.write_text(_lines(written(settled(kept, found, name))), encoding="utf-8")
        sys.stdout.write("\n  ".join([f"\n{name}:", *(differences if kept else ["is new"])]) + "\n")
        return
    assert not differences, (
        f"{name} is not as it was; if that is a gain: {WRITE}=write pytest tests/golden -s\n"
        + "\n".join(differences)
    )


def _added(
    path: Path,
    found: set[str],
    read_: Callable[[str], set[str]],
    write_: Callable[[set[str]], str],
    write: bool,
) -> set[str]:
    """What a list of all documents has not yet; where it is to be written, it gets that."""
    known = read_(path.read_text(encoding="utf-8")) if path.exists() else set()
    if write and found - known:
        path.write_text(write_(known | found), encoding="utf-8")
    return found - known


def _lines(values: Iterable[str]) -> str:
    return "".join(f"{each}\n" for each in (sorted(values) if isinstance(values, set) else values))
