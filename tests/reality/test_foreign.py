"""Files of other programs: each is named, with what to export instead; and decks whose name says
another language than they have.
"""

import io
import re
import zipfile
from pathlib import Path

import pytest

from service.platform.errors import Invalid
from tests.support.imported import imported
from tests.support.places import shared_file
from tests.support.reality import kept


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("run.raw", b"|CF,2,1,1;|CK,1,3,1,1;\r\n\0", "imc FAMOS file.*TDMS"),
        ("scan.svd", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(64), "Polytec scan.*export UFF"),
        ("run.dxd", b"\x01\0\x02", "DEWESoft file.*export UFF"),
        ("run.rsp", b"FORMAT\0\0BINARY\0\0", "RPC III"),
        ("run.tdm", b'<?xml version="1.0"?>\n<usi:tdm xmlns:usi="x">', "DIAdem.*TDMS"),
        ("run.csv", b"%PDF-1.7\n1 0 2 0\n2 0 1 0\n", "is a PDF"),
        ("run.xls", b"<html><table>", "save its table as CSV"),
        ("run.abc", b"\x01\0\x02\0", "format that is not read; export one of UFF"),
    ],
)
def test_measured_data(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(Invalid, match=said):
        kept(path)


def zipped(name: str, content: bytes) -> bytes:
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr(name, content)
    return archive.getvalue()


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.cdb", b"/COM,ANSYS RELEASE 2022\n/PREP7\n", "deck of Ansys.*Matrix Market"),
        ("a.dat", b"! made by hand\n/batch\n", "deck of Ansys"),
        ("a.inp", b"$ by a pre-processor\n*KEYWORD\n*NODE\n", "deck of LS-DYNA"),
        ("a.mat", b"", "matrices of MATLAB.*Matrix Market"),
        ("a.zip", zipped("K.mat", b"\0"), "K.mat is matrices of MATLAB.*Matrix Market"),
        ("a.op2", b"", "results of Nastran.*the deck itself"),
        ("a.stp", b"ISO-10303-21;\n", "geometry without elements"),
        ("a.mphtxt", b"# Created by COMSOL\n", "export bulk data"),
        ("a.inp", "*NODE\n1,0.,0.,0.\n".encode("utf-16"), "save it as ANSI or UTF-8"),
        ("a.bdf", "GRID,1\n".encode("utf-16"), "save it as ANSI or UTF-8"),
    ],
)
def test_models(name: str, content: bytes, said: str) -> None:
    with pytest.raises(Invalid, match=said):
        imported(name, content)


@pytest.mark.parametrize(
    ("file", "name"),
    [("deck_two_layers.inp", "a.dat"), ("deck_continuation_plain.bdf", "a.fem"),
     ("deck_continuation_plain.bdf", "a.inp")],
)  # fmt: skip
def test_a_deck_is_read_by_its_language(file: str, name: str) -> None:
    content = shared_file("REALITY", "reality", file).read_bytes()
    assert imported(name, content).document["sets"] == imported(file, content).document["sets"]


def test_an_include_with_the_path_of_windows() -> None:
    deck = shared_file("REALITY", "reality", "deck_continuation_plain.bdf").read_text()
    grids = "".join(re.findall(r"(?m)^GRID.*\n", deck))
    rest = re.sub(r"(?m)^GRID.*\n", "", deck).replace(
        "BEGIN BULK\n", "BEGIN BULK\ninclude '..\\mesh\\grids.bdf'\n"
    )
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("main.bdf", rest)
        file.writestr("grids.bdf", grids)
    assert imported("a.zip", archive.getvalue()).document["sets"]
