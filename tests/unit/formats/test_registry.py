"""The table of formats: each row has what everything else iterates over, and a member that is
forgotten is named.
"""

import inspect
import io
import json
import re
import tomllib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import nanoarrow.ipc
import numpy as np
import pytest

from modalbase.formats import uff
from modalbase.formats.errors import FormatError
from modalbase.formats.frfs import FrfRow, Frfs, read_frfs, write_frfs
from modalbase.formats.recognise import recognise
from modalbase.formats.registry import ALL, FORMATS, WRITERS, Dependency, Format, Writer, load
from tests.support.places import ROOT
from tests.support.tables import parquet_rows

ROWS = [pytest.param(row, id=row.name) for row in ALL]
READ = [pytest.param(row, id=row.name) for row in FORMATS.values()]


@dataclass(frozen=True, eq=False)
class Placed(Frfs):
    points = {1: (0.0, 0.0, 0.0), 2: (0.1, 0.0, 0.0), 33: (0.3, 0.2, 0.0)}  # noqa: RUF012 - frozen
    description = "NONE"


RNG = np.random.default_rng(11)
TABLE = Placed(
    np.array([0.1, 0.30000000000000004, 1 / 3, 1e3]),
    RNG.standard_normal((2, 4)) + 1j * RNG.standard_normal((2, 4)),
    (FrfRow(1, 3, 33, -3), FrfRow(2, -1, 33, -3)),
    "mobility",
    RNG.uniform(size=(2, 4)),
)


@pytest.mark.parametrize("row", ROWS)
def test_a_row_has_suffix_title_and_sentence(row: Format) -> None:
    assert row.title, f"{row.name} has no title"
    assert row.about, f"{row.name} has no sentence for the guide"
    assert row.suffixes, f"{row.name} has no suffix"
    assert all(re.fullmatch(r"\.[a-z0-9]+", suffix) for suffix in row.every_suffix), row.name
    assert row.takes or row.writers, f"{row.name} is neither read nor written"
    text = (ROOT / "docs/database.md").read_text()
    assert f"| {row.title}: {row.about} |" in text, (
        f"{row.name} is not in the guide: run python -m tools.reference"
    )


def test_no_two_rows_claim_the_same() -> None:
    for member in ("every_suffix", "media_types", "marks"):
        count = Counter(each for row in ALL for each in getattr(row, member))
        assert [each for each, times in count.items() if times > 1] == [], member
    names = [writer.name for row in ALL for writer in row.writers]
    assert len(names) == len(set(names)) == len(WRITERS)
    assert next(iter(WRITERS)) == "json", "without ?format= and Accept the answer is JSON"


@pytest.mark.parametrize("row", READ)
def test_a_file_is_recognised(row: Format, tmp_path: Path) -> None:
    assert row.marks or row.opening or row.is_table, f"nothing recognises {row.name}"
    path = tmp_path / "file"
    for mark in row.marks:
        path.write_bytes(mark + bytes(64))
        assert recognise(path, "anything.csv") == row.name, mark
    for suffix in row.every_suffix:  # what has no mark is what it is called
        path.write_bytes(b"nothing of that\n")
        assert recognise(path, f"file{suffix.upper()}") == row.name, suffix
    for writer in row.writers:
        with path.open("wb") as file:
            writer.write(TABLE if writer.one_table else [TABLE], file)
        assert recognise(path) == row.name, writer.name


@pytest.mark.parametrize("row", READ)
def test_what_a_file_holds_has_a_reader(row: Format) -> None:
    if "frfs" in row.takes and row.name != "uff":  # whose datasets are read one by one
        assert row.frfs or row.arrays, f"nothing reads FRFs of {row.name}"
    if "hits" in row.takes:
        assert row.arrays or row.recording, f"nothing reads hits of {row.name}"
    assert not row.frfs or row.own_names, f"{row.name} does not say which of its files hold FRFs"


@pytest.mark.parametrize("row", ROWS)
def test_every_function_that_a_row_names_is_there(row: Format) -> None:
    named = (row.arrays, row.recording, row.frfs, row.own_names, *(w.where for w in row.writers))
    for where in filter(None, named):
        assert inspect.getdoc(load(where)), f"{row.name}: {where}"
    if row.frfs:
        assert {"quantity", "limit_bytes"} <= inspect.signature(load(row.frfs)).parameters.keys()


@pytest.mark.parametrize("need", [need for row in ALL for need in row.needs], ids=str)
def test_what_a_format_needs_is_an_extra_of_the_package(need: Dependency) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    named = [re.split("[<>=]", each)[0].lower() for each in extras[need.extra]]
    assert need.package.lower() in named, need


@pytest.mark.parametrize("row", [row for row in READ if row.values[0].needs])  # type: ignore[union-attr]
def test_what_is_not_installed_is_named(row: Format) -> None:
    for need in row.needs:
        absent = replace(row, needs=(replace(need, module="no_such_module"),))
        advice = re.escape(f"{need.package} reads: pip install 'modalbase[{need.extra}]'")
        with pytest.raises(FormatError, match=advice):
            absent.dependency("no_such_module")


def _of_json(content: bytes) -> Frfs:
    read = json.loads(content)
    rows = read["frfs"]
    values = np.array([np.array(r["real"]) + 1j * np.array(r["imag"]) for r in rows])
    return replace(TABLE, frequency_hz=np.array(read["frequency_hz"]), values=values)


def _of_arrow(content: bytes) -> Frfs:
    with nanoarrow.ipc.InputStream.from_readable(io.BytesIO(content)) as stream:
        read: Any = nanoarrow.Array(stream)
        columns = {
            name: np.array(read.child(i).to_pylist()) for i, name in enumerate(CSV_NUMBERS, 4)
        }
    values = (columns["real"] + 1j * columns["imag"]).reshape(2, -1)
    return replace(TABLE, frequency_hz=columns["frequency_hz"][: values.shape[1]], values=values)


def _of_uff(content: bytes, folder: Path) -> Frfs:
    (folder / "back.uff").write_bytes(content)
    frfs = [item for item in uff.read_file(folder / "back.uff") if isinstance(item, uff.Frf)]
    values = np.array([frf.values for frf in frfs])
    return replace(TABLE, frequency_hz=frfs[0].frequency.points(), values=values)


def _of_parquet(content: bytes) -> Frfs:
    rows = parquet_rows(content)
    columns = {name: np.array([row[name] for row in rows]) for name in CSV_NUMBERS}
    values = (columns["real"] + 1j * columns["imag"]).reshape(2, -1)
    return replace(TABLE, frequency_hz=columns["frequency_hz"][: values.shape[1]], values=values)


CSV_NUMBERS = ("frequency_hz", "real", "imag")
READ_BACK: dict[str, Callable[[bytes, Path], Frfs]] = {
    "json": lambda content, _: _of_json(content),
    "arrow": lambda content, _: _of_arrow(content),
    "parquet": lambda content, _: _of_parquet(content),
    "uff": _of_uff,
    "uff-ascii": _of_uff,
}
"""What reads FRFs back that no row with `frfs` does."""


@pytest.mark.parametrize(
    ("row", "writer"),
    [pytest.param(row, writer, id=writer.name) for row in ALL for writer in row.writers],
)
def test_what_is_written_is_read_back_to_the_bit(
    row: Format, writer: Writer, tmp_path: Path
) -> None:
    path = tmp_path / f"frfs{row.suffixes[0]}"
    if row.frfs:
        write_frfs(TABLE, path)
        back = read_frfs(path, "mobility")
        assert (back.frfs, back.quantity) == (TABLE.frfs, TABLE.quantity)
        assert back.coherence is not None
        assert back.coherence.tobytes() == TABLE.coherence.tobytes()  # type: ignore[union-attr]
    else:
        assert writer.name in READ_BACK, f"nothing reads back what {writer.name} writes"
        with path.open("wb") as file:
            writer.write(TABLE if writer.one_table else [TABLE], file)
        back = READ_BACK[writer.name](path.read_bytes(), tmp_path)
    if writer.exact:
        assert back.values.tobytes() == TABLE.values.tobytes()
        assert back.frequency_hz.tobytes() == TABLE.frequency_hz.tobytes()
    else:
        np.testing.assert_allclose(back.values, TABLE.values, rtol=1e-12)


def test_a_name_that_says_no_format_and_a_file_without_frfs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"is a '\.xls' file, expected one of .*\.npz"):
        write_frfs(TABLE, tmp_path / "frfs.xls")
    (tmp_path / "hit.wav").write_bytes(b"RIFF")
    with pytest.raises(FormatError, match="is a wav file, expected npz"):
        read_frfs(tmp_path / "hit.wav")
