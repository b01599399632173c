"""Golden documents: what a user sees, kept as data, so that a change of the code that changes it is
seen.

`check` compares a document with `tests/golden/data/NAME.json`. With MODALBASE_GOLDEN=write it
writes what is different anew and
prints it: `pytest tests/golden -s`, with `-k` for some. Compared are keys, types, lengths and the
order of lists exactly, sentences but for the numbers in them, and numbers to `CLOSE` of their size
or `SHARE` of their standard deviation, whichever is wider. Ids, times and what depends on the
machine are masked.
"""

import json
import math
import os
import platform
import re
import sys
import zlib
from collections.abc import Iterator
from html.parser import HTMLParser
from typing import Any

import httpx
import numpy as np

from tests.support.places import ROOT

DATA = ROOT / "tests" / "golden" / "data"
WRITE = "MODALBASE_GOLDEN"
CLOSE, SHARE = 1e-9, 1e-6
MOST, ROWS = 12, 24  # numbers and rows of a list that are kept whole
SAMPLE = {"numbers", "missing", "rms", "some"}

VOLATILE = {
    "host",
    "software",
    "durations_s",
    "next_cursor",
    "request_id",
    "worker",
    "progress",
    "history",
    "samples",
    "points_m",
}
"""What depends on the machine: of a search its steps on the way, of a chain how long it had to be,
and of points that are as good as their mirror images which were chosen, hang on the last bits.
"""
NO_WEIGHT = 1e-6
"""Of a pole's feature: below, rounding decides which of them comes first."""
NUMBERLESS = {"null_directions", "sizes"}
"""Of which only the names are compared: a basis of what is not known may turn, and a number of
three digits, the size of an explanation, may be rounded the other way by the last bits.
"""
VOLATILE_HEADERS = {"content-length", "date", "etag", "server", "x-request-id", "server-timing"}
_ID = re.compile(r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}")
_TIME = re.compile(r"20\d\d-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?( UTC|Z|[+-]\d\d:\d\d)?")
_DATE = re.compile(r"[A-Z][a-z]{2}, \d\d [A-Z][a-z]{2} 20\d\d \d\d:\d\d:\d\d GMT")  # in headers
_HEX = re.compile(r"(?<![\w.])(mb_[0-9a-f]{12,64}|(?=[a-f]*\d)(?=\d*[a-f])[0-9a-f]{12,64})(?!\w)")
_VERSION = re.compile(r"(?<![\w./])\d+(?:\.\d+){2,}[\w.+-]*")
_HOST = re.compile(rf"(?<=\bhost ){re.escape(platform.node())}(?![\w.-])")
_NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
DEVIATIONS = {
    "frequency_hz": "frequency_sd_hz",
    "damping_ratio": "damping_sd",
    "measured_damping": "measured_damping_sd",
    "coefficients": "standard_deviations",
    **dict.fromkeys(
        ("raw", "mean", "estimate", "interval_95", "comparable", "noise_standard_deviation"),
        "standard_deviation",
    ),
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
        (r"/(optima|coefficients|curve|predicted_damping|comparable)\b", 1e-5, 0.0, 1e-4),
        # a ten-thousandth of a degree at 1 kHz; none is known better
        (r"/channel_delay_s$", 3e-4, 1e-10, 0.0),
        (r"/(parameters|own)/\d+/", 5e-6, 0.0, 1e-4),
        # On the way of a search, what such a way makes of the model's frequencies, and what it left
        # lying.
        (r"/(starts|convergence)/", 1e-5, 0.0, 0.0),
        (r"/(bic|cost|discrepancy/\w+|significance)$", 2e-6, 0.0, 0.0),
        (r"_hz\b|/(measured_damping|damping_ratio)$|/stabilisation/", 5e-7, 0.0, 0.0),
        (r"/refused_poles/", 1e-4, 0.0, 0.0),
        (r"/(drift|model_error|noise_ratio|memory_lines)$", 1e-6, 0.0, 0.0),
        (r"/features/", 1e-6, 1e-6, 0.0),
        # A few poles beside the modes of these hits are in the series or not by the last bits.
        (r"^update-hits-free-window/", 2e-2, 0.0, 1.0),
        (
            r"^update-hits-free-window/.*/(share|correlation|mac_matrix|missed|error_percent)\b",
            0.0,
            5e-2,
            0.0,
        ),
        (
            r"^update-hits-free-window/.*(_sd(_hz)?$|standard_deviations?\b|discrepancy|significance|memory_lines|refused)",
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


OTHER_POLES = re.compile(
    r"^update-hits-free-window/.*/refused_poles/.*/(features|probability|reason)\b"
)
"""What is said of poles that are others by the last bits; how many there are and where they lie is
compared.
"""


def freeze(value: Any) -> Any:
    """A document as it is kept: masked, its long lists as a sample."""
    if isinstance(value, np.ndarray):
        return {"shape": list(value.shape), "values": freeze(_numbers(value))}
    if isinstance(value, dict):
        return {masked(name): _member(name, member) for name, member in value.items()}
    if isinstance(value, (list, tuple)):
        return _list(list(value))
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.13g}")
    return masked(value) if isinstance(value, str) else value


def _member(name: str, member: Any) -> Any:
    if name == "features" and isinstance(member, list):
        member = [each for each in member if abs(each["weight"]) > NO_WEIGHT]
    # in the OpenAPI document
    described = isinstance(member, dict) and member.keys() & {"type", "anyOf", "$ref"}
    if name in VOLATILE and member is not None and not described:
        return "<masked>"
    return _names(member) if name in NUMBERLESS else freeze(member)


def _names(value: Any) -> Any:
    return [sorted(each) for each in value] if isinstance(value, list) else sorted(value)


def _numbers(values: np.ndarray) -> list[Any]:
    flat = values.ravel()
    parts = np.column_stack([flat.real, flat.imag]).ravel() if np.iscomplexobj(flat) else flat
    return [
        None if isinstance(each, float) and not math.isfinite(each) else each
        for each in parts.tolist()
    ]


def _list(values: list[Any]) -> Any:
    known = [each for each in values if each is not None]
    numbers = all(isinstance(each, (int, float)) for each in known)
    if len(values) <= (MOST if numbers else ROWS) or all(isinstance(each, str) for each in values):
        return [freeze(each) for each in values]
    some = [freeze(values[i]) for i in np.linspace(0, len(values) - 1, 5).astype(int)]
    if numbers:
        rms = math.sqrt(sum(float(each) ** 2 for each in known) / max(len(known), 1))
        return {
            "numbers": len(values),
            "missing": len(values) - len(known),
            "rms": freeze(rms),
            "some": some,
        }
    return {"items": len(values), "some": [some[0], some[2], some[4]]}


def masked(text: str) -> str:
    """A text without ids, times, digests, versions and the host; a sentence also without its
    numbers.
    """
    dates = (_DATE, "<time>"), (_TIME, "<time>")
    for pattern, name in (
        (_ID, "<id>"),
        *dates,
        (_HEX, "<hex>"),
        (_VERSION, "<version>"),
        (_HOST, "<host>"),
    ):
        text = pattern.sub(name, text)
    return _NUMBER.sub("#", text) if " " in text else text


def different(
    kept: Any, found: Any, place: str, sd: Any = 0.0, scale: float = 0.0
) -> Iterator[str]:
    """What is not the same in two frozen documents, each by its place.

    Args:
        kept: from the file.
        found: of now.
        place: of both: the document's name and a JSON pointer.
        sd: standard deviation of a number, or those of an object's members by name.
        scale: of the numbers of an array: its root mean square.
    """
    if OTHER_POLES.search(place):
        return
    if type(kept) is not type(found):
        yield f"{place}: was {_short(kept)}, is {_short(found)}"
    elif isinstance(kept, dict):
        yield from (f"{place}/{name}: is gone" for name in kept.keys() - found.keys())
        yield from (
            f"{place}/{name}: is new, {_short(found[name])}" for name in found.keys() - kept.keys()
        )
        for name in kept.keys() & found.keys():
            size = kept["rms"] if kept.keys() == SAMPLE else scale
            yield from different(
                kept[name], found[name], f"{place}/{name}", _deviation(kept, name, sd), size
            )
    elif isinstance(kept, list):
        if len(kept) != len(found):
            yield (
                f"{place}: had {len(kept)} entries, has {len(found)}: {_short(kept)},"
                f" {_short(found)}"
            )
        for i, (one, other) in enumerate(zip(kept, found, strict=False)):
            yield from different(one, other, f"{place}/{i}", sd, scale)
    elif isinstance(kept, float):
        if abs(kept - found) > _allowed(place, max(abs(kept), abs(found), scale), sd):
            yield (
                f"{place}: was {kept!r}, is {found!r},"
                f" {abs(kept - found) / max(abs(kept), 1e-300):.1e} of it"
            )
    elif kept != found:
        yield f"{place}: was {_short(kept)}, is {_short(found)}"


def _deviation(kept: dict[str, Any], name: str, sd: Any) -> Any:
    """The standard deviation of a member, or those of the member's own: what is stated beside it,
    or about all of them.
    """
    stated = kept.get(DEVIATIONS.get(name, ""))
    if isinstance(stated, dict):
        return stated
    about = sd.get(name) if isinstance(sd, dict) else sd
    return max(each if isinstance(each, float) else 0.0 for each in (stated, about))


def _allowed(place: str, size: float, sd: float) -> float:
    """The largest difference of a number that is none."""
    rows = [(CLOSE, 0.0, SHARE), *(row[1:] for row in LOOSER if row[0].search(place))]
    return max(max(relative * size, absolute, share * sd) for relative, absolute, share in rows)


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) < 200 else f"{text[:200]}…"


def check(name: str, document: Any) -> None:
    """A document is as it is kept; or, where `WRITE` is set, it is kept as it is."""
    path, found = DATA / f"{name}.json", freeze(document)
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
    differences = sorted(different(kept, found, name))
    if os.environ.get(WRITE) and differences:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(found, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
        sys.stdout.write(
            "\n  ".join([f"\n{name}:", *(differences if kept is not None else ["is new"])]) + "\n"
        )
        return
    assert not differences, (
        f"{name} is not as it was; if that is a gain: {WRITE}=write pytest tests/golden -s\n"
        + "\n".join(differences)
    )


# --- what is not JSON ------------------------------------------------------------------------------------------------


def answered(answer: httpx.Response, body: Any) -> dict[str, Any]:
    """An answer: its status, its headers, and what was made of its body."""
    headers = {
        name: value for name, value in answer.headers.items() if name not in VOLATILE_HEADERS
    }
    return {"status": answer.status_code, "headers": headers, "body": body}


def exact(content: bytes) -> dict[str, Any]:
    """Bytes that are to stay: how many, their checksum, and how they begin."""
    begin = content[:1000].decode("utf-8", "replace").splitlines()[:7]
    return {"bytes": len(content), "crc32": zlib.crc32(content), "begin": begin}


def numeric(content: bytes) -> dict[str, Any]:
    """A text of computed numbers: what stands between them exactly, and they as numbers are
    compared.
    """
    text = masked(content.decode().replace(" ", "\t")).replace("\t", " ")
    between = _NUMBER.sub("#", text).encode()
    numbers = [float(each.replace("−", "-")) for each in _NUMBER.findall(text)]
    return {"between": exact(between), "numbers": numbers}


def beginning(content: bytes) -> dict[str, Any]:
    """Bytes of which some are computed numbers: how many, and the lines before the first of
    them.
    """
    text = bytes(byte if byte < 128 else 0 for byte in content).decode()
    return {"bytes": len(content), "begin": lines(text.partition("\0")[0])[:-1]}


class _Words(HTMLParser):
    """The text that a page shows, a line for each block."""

    _WITHIN = (
        "a",
        "abbr",
        "b",
        "code",
        "em",
        "i",
        "small",
        "span",
        "strong",
        "sub",
        "sup",
        "td",
        "th",
    )

    def __init__(self) -> None:
        super().__init__()
        self.text, self._hidden = "", 0

    def handle_starttag(self, tag: str, _: Any) -> None:
        self._hidden += tag in ("script", "style")
        self.text += " " if tag in self._WITHIN else "\n"

    def handle_endtag(self, tag: str) -> None:
        self._hidden -= tag in ("script", "style")
        self.text += " " if tag in self._WITHIN else "\n"

    def handle_data(self, data: str) -> None:
        self.text += "" if self._hidden else re.sub(r"\s+", " ", data)


def lines(text: str) -> list[str]:
    """The lines of a text, without their numbers."""
    found = (masked(f"{line} ").split() for line in text.splitlines())
    return [" ".join(words) for words in found if words]


def page_lines(html: str) -> list[str]:
    """The text of a page."""
    words = _Words()
    words.feed(html)
    return lines(words.text)
