"""What the command line and the library refuse before a service is asked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from typer.testing import CliRunner

import modalbase
from modalbase.client.errors import ClientError
from modalbase.client.rest import Rest
from modalbase.objects.projects import Structure
from modalbase.objects.thing import Table
from service.app.cli.command import app


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("coupons b A1.csv", "state with --about what the files hold: dimensions, columns and their units"),
        (
            "coupons b A1.csv --about list.json",
            r"list.json: specimens is no object such as {\"A3\": {\"excluded\": true}}",
        ),
        ("coupons b A1.csv --about A1.csv", "A1.csv is not JSON"),
        ("export latest --what modes --fmin 3 --out x.csv", "--fmin choose FRFs, not modes"),
        ("update c --idempotency-key ä", "--idempotency-key takes printable ASCII alone"),
        ("points c A1.csv", "A1.csv, line 1: is '1,2', expected label,x_mm"),
    ],
)
def test_a_command_that_cannot_be_meant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, says: str) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "A1.csv").write_text("1,2\n")
    (tmp_path / "list.json").write_text('{"specimens": []}')
    result = CliRunner().invoke(app, words.split())
    assert isinstance(result.exception, ClientError), result.output
    assert says.replace('\\"', '"') in str(result.exception)


REST = Rest(cast("Any", None))
FRFS = {"type": 58, "func_type": 4, "x": [1.0, 2.0], "ordinate_spec_data_type": 12}

WRONG: dict[str, tuple[type[Exception], str, Callable[[], object]]] = {
    "a call that there is not": (AttributeError, "the REST contract has no call 'list_cats'", lambda: REST.list_cats),
    "an id too many": (TypeError, r"list_projects\(\) takes no id and got 1", lambda: REST.list_projects("x")),
    "a query that it has not": (
        TypeError,
        r"list_projects\(\) has no colour; it has",
        lambda: REST.list_projects(colour=1),
    ),
    "no name of the library": (AttributeError, "has no attribute 'cats'", lambda: cast("Any", modalbase).cats),
    "no field of a thing": (
        AttributeError,
        "a structure has no 'colour'",
        lambda: Structure(cast("Any", None), {}).colour,
    ),
    "no row of a table": (KeyError, "'Gxy'; there is Ex, Ey", lambda: Table([{"name": "Ex"}, {"name": "Ey"}])["Gxy"]),
    "values of another shape": (
        ValueError,
        r"values have shape \(1, 3\), expected \(1, 2\)",
        lambda: modalbase.Frfs.from_arrays([1, 2], [1, 2, 3], response=[(1, 3)], reference=[(2, 3)]),
    ),
    "no FRF of pyuff's": (ValueError, "no dataset 58 is an FRF", lambda: modalbase.Frfs.from_pyuff([{"type": 15}])),
    "FRFs on two axes": (
        ValueError,
        "the FRFs have several frequency axes or quantities; take those of one",
        lambda: modalbase.Frfs.from_pyuff([FRFS, {**FRFS, "x": np.array([1.0, 3.0])}]),
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_script_is_corrected_before_anything_is_sent(case: str) -> None:
    kind, words, act = WRONG[case]
    with pytest.raises(kind, match=words):
        act()
