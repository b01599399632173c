"""What a file says of a test in words, beside its samples: when it was measured, with which
instruments, how sensitive a channel is.

The words are texts by name: properties of TDMS, chunks of a wav, lines above a table, texts of an
npz or a .mat. A name counts where it is one of a few that mean one thing; all else is left out.
"""

import itertools
import re
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from modalbase.formats.registry import FORMATS, load

Texts = Mapping[str, str]
_DAY = ("%d-%b-%y", "%d-%b-%Y", "%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y")
_CLOCK = ("", " %H:%M:%S", " %H:%M", "T%H:%M:%S", " %I:%M:%S %p", " %I:%M %p")
_FORMS = tuple(map("".join, itertools.product(_DAY, _CLOCK)))
_FRACTION = re.compile(r"(:\d\d)[.,]\d+")
_WHEN = re.compile(
    r"(?:(?:info|header|meta|metadata|general)_)?(?:date_?time|time_?stamp|(?:performed|measured|recorded|acquired)(?:_at|_on)?|wf_start_time"
    r"|(?:test|measurement|recording|start|acquisition)_?(?:date|time)|date|datum|messdatum|icrd)"
)
_TIME = re.compile(r"time|zeit|uhrzeit|(?:test|measurement|recording|start)_?time")
_CLOCK_ALONE = re.compile(r"\d{1,2}:\d\d(:\d\d)?( [AP]M)?")
_INSTRUMENTS = {
    "hammer": r"(?:impact_?|impulse_?)?hammer|impulshammer",
    "sensor": r"sensor|accelerometer|acceler|aufnehmer",
    "analyser": r"analy[sz]er|data_?logger|recorder|daq|device|front_?end",
}
_KINDS = {
    "model": r"model|type|model_?(?:name|number|no)|product|name",
    "serial": r"serial|s_?n|serial_?(?:number|no|nr)|serien_?nummer",
}
_SENSITIVITY = re.compile(r"[0-9.,]+(?:[eE][+-]?\d+)? ?[mµu]?(?:V|C|pC)/\S+")
_MOST = 200  # characters of a text that is looked at
_MOST_LINES = 200  # of a table


def texts_in(path: Path, form: str, most_bytes: int) -> Texts:
    """What a file says in words, by name.

    Args:
        path: where it lies.
        form: name of its format.
        most_bytes: that its arrays may take.

    Raises:
        FormatError: it cannot be read.
    """
    row = FORMATS.get(form)
    own = load(row.texts)(path, most_bytes) if row and row.texts else {}
    return {
        _plain(name): text
        for name, value in own.items()
        if 0 < len(text := " ".join(str(value).split())) <= _MOST
    }


def _plain(name: str) -> str:
    return re.sub(r"[^a-zµ0-9]+", "_", name.lower()).strip("_")


def table_texts(path: Path, _most_bytes: int) -> Texts:
    """The lines above a table of text: what stands before the first sign, and behind it."""
    from modalbase.formats.tables import open_table

    table = open_table(path)
    with table.open_text() as file:
        above = itertools.islice(file, min(table.layout.first_line - 1, _MOST_LINES))
        lines = [line.strip(" \t\r\n#%;,") for line in above]
    parts = (re.split(r"\s*[:=;,\t]\s*", line, maxsplit=1) for line in lines)
    texts = {}
    for name, *rest in parts:
        cells = {cell.strip('" ') for cell in re.split(r"[;\t]", "".join(rest))} - {""}
        if len(cells) == 1:  # LabVIEW says it once for each column
            texts[name.strip('"')] = cells.pop()
    return texts


def array_texts(path: Path, most_bytes: int) -> Texts:
    """The texts beside the arrays of an npz or a .mat."""
    from modalbase.formats.recognise import recognise
    from modalbase.formats.records.variables import read_named

    return read_named(path, FORMATS[recognise(path)].suffixes[0], most_bytes)[1]


def performed_at(texts: Texts) -> datetime | None:
    """When a test was measured, of the texts of its file; None where they say no day, or several.

    >>> performed_at({"date": "2025/06/02", "time": "10:05:00,25"})
    datetime.datetime(2025, 6, 2, 10, 5)
    """
    clocks = {text for name, text in texts.items() if _TIME.fullmatch(name)}
    clocks = {clock for clock in map(_whole, clocks) if _CLOCK_ALONE.fullmatch(clock)}
    dates = set()
    for name, text in texts.items():
        if _WHEN.fullmatch(name) and (at := date_in(text)) is not None:
            midnight = (at.hour, at.minute, at.second) == (0, 0, 0)
            with_clock = date_in(f"{text} {min(clocks)}") if midnight and len(clocks) == 1 else None
            dates.add(with_clock or at)
    return dates.pop() if len(dates) == 1 else None


def _whole(text: str) -> str:
    return _FRACTION.sub(r"\1", " ".join(text.split()))


def date_in(text: str) -> datetime | None:
    """A date as analysers write it; None of other words, of a day that could be two, and of one in
    2000 that means nothing.

    >>> date_in("02-Jun-25 10:05:00"), date_in("NONE"), date_in("02/06/2025")
    (datetime.datetime(2025, 6, 2, 10, 5), None, None)
    """
    plain, dates = _whole(text), set()
    try:
        dates.add(datetime.fromisoformat(plain))
    except ValueError:
        for form in _FORMS:
            try:
                dates.add(datetime.strptime(plain, form))
            except ValueError:
                continue
    day = dates.pop() if len(dates) == 1 else None
    meaningless = day is None or (day.year, day.month, day.day) in ((2000, 1, 1), (1904, 1, 1))
    return None if meaningless else day


def instruments(texts: Texts) -> dict[str, str]:
    """Model and serial number of hammer, sensor and analyser, by members of a campaign; what a file
    says of several is left out.

    >>> instruments({"hammer": "086C03", "sensor_serial": "LW1234"})
    {'hammer/model': '086C03', 'sensor/serial': 'LW1234'}
    """
    members: dict[str, set[str]] = {}
    for name, text in texts.items():
        for instrument, words in _INSTRUMENTS.items():
            match = re.fullmatch(rf"(?:{words})(?:_(?P<kind>.+))?", name)
            kind = match and (match["kind"] or "model")
            for member, ways in _KINDS.items():
                if kind and re.fullmatch(ways, kind):
                    members.setdefault(f"{instrument}/{member}", set()).add(text)
    return {member: values.pop() for member, values in members.items() if len(values) == 1}


def with_sensitivities(mapping: dict[str, Any], texts: Texts) -> dict[str, Any]:
    """A proposed mapping with the sensitivities that a file states of its channels in volts."""
    channels = []
    for channel in mapping.get("channels", []):
        own = _plain(str(channel["variable"]))
        stated = next((texts[f"{own}_{word}"] for word in ("sensitivity", "sens")
                     if f"{own}_{word}" in texts), "")  # fmt: skip
        in_volts = str(channel.get("unit") or "").endswith("V") and _SENSITIVITY.fullmatch(stated)
        channels.append({**channel, "sensitivity": stated} if in_volts else channel)
    return {**mapping, "channels": channels} if channels else mapping
