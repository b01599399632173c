"""What of a document is kept: without ids, times and what depends on the machine, its long lists as
a sample.
"""

import json
import math
import platform
import re
import zlib
from html.parser import HTMLParser
from typing import Any

import httpx
import numpy as np

MOST, ROWS = 12, 24  # numbers and rows of a list that are kept whole
WIDTH, PRINTED = 40, 48  # characters of a line of a file, and of a page
LARGEST = 2  # entries of a list that is ordered by size
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
    "sizes",
}
"""What depends on the machine: of a search its steps on the way, of a chain how long it had to be,
and of points that are as good as their mirror images which were chosen, hang on the last bits.
"""
OF_CONTENT = ("accept", "content-d", "content-type", "location", "vary")
_ID = re.compile(r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}")
_TIME = re.compile(r"20\d\d-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?( UTC|Z|[+-]\d\d:\d\d)?")
_DATE = re.compile(r"[A-Z][a-z]{2}, \d\d [A-Z][a-z]{2} 20\d\d \d\d:\d\d:\d\d GMT")  # in headers
_HEX = re.compile(r"(?<![\w.])(mb_[0-9a-f]{12,64}|(?=[a-f]*\d)(?=\d*[a-f])[0-9a-f]{12,64})(?!\w)")
_VERSION = re.compile(r"(?<![\w./])\d+(?:\.\d+){2,}[\w.+-]*")
_HOST = re.compile(rf"(?<=\bhost ){re.escape(platform.node())}(?![\w.-])")
_NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
NAMED = {
    *(
        "recipe",
        "request",
        "band_hz",
        "unit",
        "initial",
        "prior_mean",
        "prior_sd",
        "priority",
        "attempt",
        "limit",
    ),
    *(
        "starts",
        "convergence",
        "stabilisation",
        "features",
        "used",
        "pairing",
        "number",
        "energy",
        "motion",
        "missed",
    ),
    *(
        "comparable",
        "noise_standard_deviation",
        "null_directions",
        "by_mechanism",
        "significance",
        "model_modes",
    ),
    *("campaign_name", "href", "version"),
}
"""Members whose values a request states, that follow from others, or that are steps on the way:
only their names are kept.
"""
DATA_OF_TRACE = ("name", "x", "y", "z", "text", "error_y")


def freeze(value: Any) -> Any:
    """A document as it is kept: masked, its long lists as a sample."""
    if isinstance(value, np.ndarray):
        return {"shape": list(value.shape), "values": freeze(_numbers(value))}
    if isinstance(value, dict) and value.keys() >= {"data", "layout"}:
        return freeze(_figure(value))
    if isinstance(value, dict):
        return {masked(name): _member(name, member) for name, member in value.items()}
    if isinstance(value, (list, tuple)):
        return _list(list(value))
    return masked(value) if isinstance(value, str) else value


def _member(name: str, member: Any) -> Any:
    if (
        name == "curve"
        and isinstance(member, dict)
        and member.keys() == {"frequency_hz", "damping_ratio"}
    ):
        return "<masked>"
    if name in VOLATILE | NAMED and member is not None:
        return "<masked>"
    if name in ("coefficients", "standard_deviations") and isinstance(member, dict):
        return list(freeze(member).values())  # the law's name states theirs
    if name == "identification" and isinstance(member, dict) and "modes" in member:
        member = {**member, "modes": len(member["modes"])}  # which the update's rows have
    if name == "findings" and isinstance(member, list) and member and "criterion" in member[0]:
        member = member[:LARGEST]
    if name == "own" and isinstance(member, list):
        member = [{part: each[part] for part in each if part != "budget"} for each in member]
    if name == "budget" and isinstance(member, list):
        member = [{"source": each["source"], "share": each["share"]} for each in member[:LARGEST]]
    return freeze(member)


def _figure(figure: dict[str, Any]) -> dict[str, Any]:
    """A figure by the data of its traces, its title and its axes; of how it looks a checksum."""
    layout = figure["layout"]
    titles = {
        name: part["title"]
        for name, part in layout.items()
        if isinstance(part, dict) and part.get("title")
    }
    traces = [
        {
            **{
                name: trace[name]
                for name in DATA_OF_TRACE
                if name in trace and not (name == "x" and len(trace[name]) > MOST)
            },
            "style": _checksum(
                {name: part for name, part in trace.items() if name not in DATA_OF_TRACE}
            ),
        }
        for trace in figure["data"]
    ]
    texts = {
        name: part["text"] if isinstance(part, dict) else part for name, part in titles.items()
    }
    title = layout.get("title")
    heading = title["text"] if isinstance(title, dict) else title
    return {"title": heading, "axes": texts, "style": _checksum(layout), "data": traces}


def _checksum(value: Any) -> int:
    """Of a value but for the numbers in it."""

    def plain(each: Any) -> Any:
        if isinstance(each, dict):
            return {name: plain(part) for name, part in sorted(each.items())}
        if isinstance(each, (list, tuple)):
            return [plain(part) for part in each] if len(each) <= ROWS else True
        return (
            masked(f"{each} ")
            if isinstance(each, str)
            else "#"
            if isinstance(each, float)
            else each
        )

    return zlib.crc32(json.dumps(plain(value)).encode()) % 0xFFFF


def _numbers(values: np.ndarray) -> list[Any]:
    flat = values.ravel()
    parts = np.column_stack([flat.real, flat.imag]).ravel() if np.iscomplexobj(flat) else flat
    return [
        None if isinstance(each, float) and not math.isfinite(each) else each
        for each in parts.tolist()
    ]


def _list(values: list[Any]) -> Any:
    known = [each for each in values if each is not None]
    if (
        len(values) > 3
        and isinstance(values[0], str)
        and all(masked(each) == masked(values[0]) for each in known)
    ):
        return {"items": len(values), "each": freeze(values[0])}
    numbers = all(isinstance(each, (int, float)) for each in known)
    if len(values) <= (MOST if numbers else ROWS) or all(isinstance(each, str) for each in values):
        return [freeze(each) for each in values]
    some = [freeze(values[i]) for i in np.linspace(0, len(values) - 1, 3).astype(int)]
    if numbers:
        rms = math.sqrt(sum(float(each) ** 2 for each in known) / max(len(known), 1))
        return {
            "numbers": len(values),
            "missing": len(values) - len(known) or None,
            "rms": rms,
            "some": some,
        }
    return {"items": len(values), "some": some}


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


# --- what is not JSON ------------------------------------------------------------------------------------------------


def answered(answer: httpx.Response, body: Any) -> dict[str, Any]:
    """An answer: its status, its headers, and what was made of its body."""
    headers = {name: value for name, value in answer.headers.items() if name.startswith(OF_CONTENT)}
    return {"status": answer.status_code, "headers": headers, "body": body}


def exact(content: bytes) -> dict[str, Any]:
    """Bytes that are to stay: how many, their checksum, and how they begin."""
    begin = content[:1000].decode("utf-8", "replace").splitlines()[:2]
    return {
        "bytes": len(content),
        "crc32": zlib.crc32(content),
        "begin": [line[:WIDTH] for line in begin],
    }


def numeric(content: bytes) -> dict[str, Any]:
    """A text of computed numbers: what stands between them exactly, and they as numbers are
    compared.
    """
    text = masked(content.decode().replace(" ", "\t")).replace("\t", " ")
    between = _NUMBER.sub("#", text).encode()
    numbers = [float(each.replace("−", "-")) for each in _NUMBER.findall(text)]
    return {"bytes": len(between), "crc32": zlib.crc32(between), "numbers": numbers}


def beginning(content: bytes) -> dict[str, Any]:
    """Bytes of which some are computed numbers: how many, and the lines before the first of
    them.
    """
    text = bytes(byte if byte < 128 else 0 for byte in content).decode()
    begin = lines(text.partition("\0")[0])[:-1]
    return {
        "bytes": len(content),
        "lines": len(begin),
        "crc32": zlib.crc32("\n".join(begin).encode()),
    }


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
    return [" ".join(words)[:PRINTED] for words in found if words]


def page_lines(html: str) -> list[str]:
    """The text of a page."""
    words = _Words()
    words.feed(html)
    return lines(words.text)
