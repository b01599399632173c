"""Bad decks are refused with a line, a card and what to do; damaged ones never crash."""

import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modalbase.formats.errors import FormatError
from modalbase.formats.models.inp import lines, mesh, read_inp
from modalbase.formats.models.model import FiniteElementModel
from tests.support.damage import damaged
from tests.unit.formats.models.bad_decks import BAD
from tests.unit.formats.models.decks import CAE, PLATE
from tests.unit.formats.models.test_inp import CARRIED, read


@pytest.mark.parametrize("name", BAD)
def test_bad_decks(name: str) -> None:
    deck, said = BAD[name]
    assert deck not in (PLATE, CAE), "the deck is the good one"
    with pytest.raises(FormatError) as caught:
        read(deck)
    assert re.search(said, str(caught.value)), str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh, "MOST_NODES", 5)
    with pytest.raises(FormatError, match=r"^line 9: \*NODE is node 6; at most 5 are read"):
        read(PLATE)
    monkeypatch.undo()
    monkeypatch.setattr(mesh, "MOST_ELEMENTS", 1)
    with pytest.raises(FormatError, match=r"^line 12: \*ELEMENT is element 2; at most 1 are read"):
        read(PLATE)
    monkeypatch.undo()
    monkeypatch.setattr(lines, "MOST_LINES", 20)
    with pytest.raises(FormatError, match=r"^the deck has more than 20 lines, which is the most"):
        read(PLATE)
    monkeypatch.undo()
    monkeypatch.setattr(mesh, "MOST_MEMBERS", 1000)
    held = "*BOUNDARY\n" + "NALL, 1\n" * 200
    with pytest.raises(FormatError, match=r"\*BOUNDARY takes the members of all sets above 1000"):
        read(PLATE.replace("*STEP", held + "*STEP", 1))
    many = "".join(f"*NSET, NSET=N{k}, GENERATE\n1, 999999999\n" for k in range(200))
    with pytest.raises(
        FormatError, match=r"\*NSET takes the members of all sets above 1000, which is the most that is read"
    ):
        read(PLATE.replace("*STEP", many + "*STEP", 1))


WHOLE = [PLATE.replace("*STEP", CARRIED + "*STEP", 1), CAE]


def harmless(text: str) -> None:
    try:
        model = read_inp(text.encode("latin-1", "replace"))
    except FormatError:
        return
    assert isinstance(model, FiniteElementModel)
    assert np.all(np.isfinite(model.nodes))
    for block in model.elements:
        assert np.all(np.isfinite(block.axes))
        assert block.nodes.max() < len(model.nodes)


FIELDS = [
    "", "0", "-1", "1", "7", "999999999", "1e308", "-1e-308", "nan",
    "S8R", "B31", "Rib-1.2", "Both", "x", "*", '"', "=", "GENERATE",
]  # fmt: skip


@settings(max_examples=500, deadline=None)
@given(damaged(WHOLE, FIELDS))
def test_damaged_decks(text: str) -> None:
    harmless(text)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=300))
def test_random_bytes(content: bytes) -> None:
    harmless(content.decode("latin-1"))
    harmless("*NODE\n" + content.decode("latin-1"))


def test_files_that_include_others_twice_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lines, "MOST_LINES", 500)
    files = {f"{k}.inp": f"*INCLUDE, INPUT={k + 1}.inp\n".encode() * 2 for k in range(9)} | {"9.inp": b"*NODE\n"}
    with pytest.raises(FormatError, match=r"the deck has more than 500 lines"):
        read_inp(b"*INCLUDE, INPUT=0.inp\n", files)
