"""The client alone: what it asks, what it refuses before anything is sent, tables of points, other
libraries' words.
"""

import io
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import httpx
import numpy as np
import pytest
from typer.testing import CliRunner

import modalbase
from modalbase.client.connection import Connection
from modalbase.client.errors import ClientError, Exit
from modalbase.client.rest import Rest
from modalbase.commands.measuring import read_points
from modalbase.commands.options import json_file
from modalbase.objects.projects import Structure
from modalbase.objects.thing import Table
from service.app.cli.command import app

Answer = Callable[[httpx.Request], httpx.Response]


def at(answer: Answer) -> Connection:
    return Connection.over(
        httpx.Client(base_url="http://lab:8000", transport=httpx.MockTransport(answer))
    )


def _nobody(_: httpx.Request) -> httpx.Response:
    raise httpx.ConnectError("connection refused")


@pytest.mark.parametrize(
    ("answer", "message", "code"),
    [
        (_nobody, "no answer from http://lab:8000: connection refused; is the service up", Exit.UNREACHABLE),
        (lambda _: httpx.Response(200, text="<html>"), "does not answer in JSON; is it modalbase's", Exit.UNREACHABLE),
        (lambda _: httpx.Response(404, text="nginx"), "lab answers 404, and not as modalbase does", Exit.UNREACHABLE),
        (lambda _: httpx.Response(503, json={"detail": "is starting"}), "is starting (503)", Exit.UNREACHABLE),
        (lambda _: httpx.Response(409, json={"detail": "has jobs"}), "has jobs (409)", Exit.REFUSED),
        (lambda _: httpx.Response(422, json={"detail": "", "errors": [{"pointer": "", "detail": "is empty"}]}),
         "body: is empty (422)", Exit.REFUSED),
    ],
)  # fmt: skip
def test_every_way_to_ask_says_what_went_wrong(
    answer: Answer, message: str, code: Exit, tmp_path: Path
) -> None:
    service, target = at(answer), tmp_path / "file"
    ways: list[Callable[[], Any]] = [
        lambda: service.get("campaigns"),
        lambda: service.call("GET", "campaigns"),
    ]
    ways += [
        lambda: list(service.lines("events")),
        lambda: service.download("frfs", target, lambda *_: None),
    ]
    for ask in ways[:1] if "JSON" in message else ways:  # only what is asked as JSON must be JSON
        with pytest.raises(ClientError) as refused:
            ask()
        assert message in str(refused.value)
        assert refused.value.code is code
    assert not list(tmp_path.iterdir())  # nothing half written


def test_a_list_is_fetched_page_by_page_up_to_the_number_asked_for() -> None:
    asked: list[int] = []

    def page(request: httpx.Request) -> httpx.Response:
        first, limit = int(request.url.params.get("cursor", 0)), int(request.url.params["limit"])
        asked.append(limit)
        stop = min(first + min(limit, 1000), 2500)
        items = [{"id": i} for i in range(first, stop)]
        return httpx.Response(
            200, json={"items": items, "next_cursor": str(stop) if stop < 2500 else None}
        )

    service = at(page)
    assert [one["id"] for one in service.pages("frfs")] == list(range(2500))
    assert len(list(service.pages("frfs", most=1200))) == 1200
    assert list(service.pages("frfs", most=0)) == []
    assert asked == [1000, 1000, 1000, 1000, 200]


def test_a_download_goes_to_a_file_a_device_or_standard_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = at(lambda _: httpx.Response(200, content=b"12345"))
    seen: list[tuple[int, int | None]] = []
    assert service.download("x", tmp_path / "file", lambda *now: seen.append(now)) == 5
    assert ((tmp_path / "file").read_bytes(), seen) == (b"12345", [(5, 5)])
    assert service.download("x", Path("/dev/null"), lambda *_: None) == 5
    out = io.BytesIO()
    monkeypatch.setattr("sys.stdout", SimpleNamespace(buffer=out))
    assert service.download("x", None, lambda *_: None) == 5
    assert out.getvalue() == b"12345"
    with pytest.raises(ClientError, match=r"cannot write .*: No such file or directory") as refused:
        service.download("x", tmp_path / "nowhere" / "file", lambda *_: None)
    assert refused.value.code is Exit.USAGE
    assert at(lambda _: httpx.Response(204)).call("DELETE", "x") is None


def test_a_call_of_the_contract_is_sent_as_it_is_meant() -> None:
    sent: list[httpx.Request] = []
    rest = Rest(at(lambda request: sent.append(request) or httpx.Response(200, json={})))
    rest.get_campaign("a/b")
    rest.create_project(body={"name": "bridge"})
    rest.create_frfs("1", content=b"7,3", content_type="text/csv", quantity=None)
    assert (sent[2].content, sent[2].headers["content-type"], sent[2].url.query) == (
        b"7,3",
        "text/csv",
        b"",
    )
    assert sent[0].url.raw_path == b"/api/v1/campaigns/a%2Fb"
    assert (sent[1].method, sent[1].content) == ("POST", b'{"name":"bridge"}')
    assert {"get_campaign", "create_project"} <= set(dir(rest))


@pytest.mark.parametrize(
    ("text", "message"), [("{", "is not JSON"), ("[1]", "holds no JSON object")]
)
def test_a_file_that_holds_no_json_object_is_named(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "recipe.json").write_text(text)
    with pytest.raises(ClientError, match=f"recipe.json {message}") as refused:
        json_file(tmp_path / "recipe.json")
    assert refused.value.code is Exit.USAGE
    with pytest.raises(ClientError, match="is not JSON"):
        json_file(tmp_path / "missing.json")
    (tmp_path / "recipe.json").write_text('\ufeff{"a": 1}')
    assert json_file(tmp_path / "recipe.json") == {"a": 1}


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("coupons b A1.csv", "state with --about what the files hold: dimensions, columns and their units"),
        ("coupons b A1.csv --about list.json",
         r"list.json: specimens is no object such as {\"A3\": {\"excluded\": true}}"),
        ("coupons b A1.csv --about A1.csv", "A1.csv is not JSON"),
        ("export latest --what modes --fmin 3 --out x.csv", "--fmin choose FRFs, not modes"),
        ("update c --idempotency-key ä", "--idempotency-key takes printable ASCII alone"),
        ("points c A1.csv", "A1.csv, line 1: is '1,2', expected label,x_mm"),
    ],
)  # fmt: skip
def test_a_command_that_cannot_be_meant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "A1.csv").write_text("1,2\n")
    (tmp_path / "list.json").write_text('{"specimens": []}')
    result = CliRunner().invoke(app, words.split())
    assert isinstance(result.exception, ClientError), result.output
    assert says.replace('\\"', '"') in str(result.exception)


REST = Rest(cast("Any", None))
FRFS = {"type": 58, "func_type": 4, "x": [1.0, 2.0], "ordinate_spec_data_type": 12}

WRONG: dict[str, tuple[type[Exception], str, Callable[[], object]]] = {
    "a call that there is not": (AttributeError, r"the REST contract has no call 'list_cats'; dir\(\) lists them",
        lambda: REST.list_cats),
    "an id too many": (TypeError, r"list_projects\(\) takes no id and got 1", lambda: REST.list_projects("x")),
    "too few ids": (TypeError, r"get_campaign\(\) takes campaign_id and got 0", lambda: REST.get_campaign()),
    "a query that it has not": (TypeError, r"\(\) has no colour; it has", lambda: REST.list_projects(colour=1)),
    "a query of what has none": (TypeError, r"\(\) has no page; it has no query",
        lambda: REST.get_campaign("1", page=2)),
    "no name of the library": (AttributeError, "has no attribute 'cats'", lambda: cast("Any", modalbase).cats),
    "no field of a thing": (AttributeError, "there is no 'colour' of this structure",
        lambda: Structure(cast("Any", None), {}).colour),
    "no row of a table": (KeyError, "'Gxy'; there is Ex, Ey", lambda: Table([{"name": "Ex"}, {"name": "Ey"}])["Gxy"]),
    "values of another shape": (ValueError, r"values have shape \(1, 3\), expected \(1, 2\)",
        lambda: modalbase.Frfs.from_arrays([1, 2], [1, 2, 3], response=[(1, 3)], reference=[(2, 3)])),
    "no FRF of pyuff's": (ValueError, "no dataset 58 is an FRF", lambda: modalbase.Frfs.from_pyuff([{"type": 15}])),
    "FRFs on two axes": (ValueError, "the FRFs have several frequency axes or quantities; take those of one",
        lambda: modalbase.Frfs.from_pyuff([FRFS, {**FRFS, "x": np.array([1.0, 3.0])}])),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_script_is_corrected_before_anything_is_sent(case: str) -> None:
    kind, words, act = WRONG[case]
    with pytest.raises(kind, match=words):
        act()


def test_points_are_read_in_metres(tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    for text in (
        "point;y_m;x_mm;z_mm\n7;-0,02;112,5;1\n\n",
        "\ufefflabel,x_m,z_m,y_mm\n 7,0.1125,0.001,-20\n",
    ):
        file.write_text(text)
        (point,) = read_points(file)
        assert point["label"] == 7
        assert [point["x_m"], point["y_m"], point["z_m"]] == pytest.approx([0.1125, -0.02, 0.001])
    file.write_text("label\tx_mm\ty_mm\n1\t2\t3\n")
    assert read_points(file)[0]["z_m"] == 0
    file.write_text("Points of June\n\nLabel  X (mm)  Y (mm)\n1 2.5 3\n")
    assert read_points(file)[0]["x_m"] == 0.0025
    file.write_text("point;x;y;z\n-;mm;mm;in\n1;2;3;1\n", "utf-16")
    assert read_points(file) == [{"label": 1, "x_m": 0.002, "y_m": 0.003, "z_m": 0.0254}]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: is '', expected label,x_mm,y_mm,z_mm"),
        ("label,x,y\n", "the header: is 'label,x,y', expected label,x_mm"),
        ("label,x_mm,x_m,y_m\n", "the header: is 'label,x_mm,x_m,y_m', expected label,x_mm"),
        ("label,x_mm,y\n1,2,3\n", "the header: is 'label,x_mm,y', expected label,x_mm"),
        ("label,x_mm,z_mm\n", "expected label,x_mm"),
        ("label,x_mm,y_mm\n\n1,2\n", "line 3: has 2 cells, the header has 3"),
        ("label,x_mm,y_mm\n1,2,left\n", "line 2, y: is 'left', expected a number"),
        ("label,x_mm,y_mm\n1.5,2,3\n", "line 2, label: is '1.5', expected a whole number"),
    ],
)
def test_what_is_no_table_of_points_is_named(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "points.csv"
    file.write_text(text)
    with pytest.raises(ClientError) as refused:
        read_points(file)
    assert message in str(refused.value)


# --- FRFs and tables in the words of other libraries, where these are installed
# -----------------------------------------


@pytest.fixture
def frfs() -> modalbase.Frfs:
    rng = np.random.default_rng(2)
    values = rng.standard_normal((2, 5)) + 1j * rng.standard_normal((2, 5))
    pairs = {"response": [(1, 3), (2, -3)], "reference": [(5, 3), (5, 3)]}
    return modalbase.Frfs.from_arrays(np.linspace(10.0, 14.0, 5), values, **pairs)


def test_an_array_of_xarray_has_points_and_lines(frfs: modalbase.Frfs) -> None:
    pytest.importorskip("xarray")
    array = frfs.to_xarray()
    assert array.dims == ("frf", "frequency_hz")
    np.testing.assert_array_equal(array.values, frfs.values)
    np.testing.assert_array_equal(array.sel(frequency_hz=12.0).values, frfs.values[:, 2])
    assert list(array.response_point.values) == [1, 2]
    assert list(array.reference_point.values) == [5, 5]


def test_a_model_of_sdypy_keeps_what_it_was_given(frfs: modalbase.Frfs) -> None:
    ema = pytest.importorskip("sdypy.EMA")
    model = ema.Model(**frfs.to_sdypy(), lower=10, upper=14)
    pairs = {"response": [(1, 3), (2, -3)], "reference": [(5, 3), (5, 3)]}
    back = modalbase.Frfs.from_sdypy(model, **pairs)
    assert back.quantity == frfs.quantity == "accelerance"
    np.testing.assert_array_equal(back.values, frfs.values[:, : back.frequency_hz.size])
    np.testing.assert_array_equal(back.frequency_hz, frfs.frequency_hz[: back.frequency_hz.size])
    assert back.frequency_hz.size >= 4  # the model cuts at its upper frequency


def test_a_table_becomes_a_data_frame() -> None:
    pandas = pytest.importorskip("pandas")
    rows = [{"name": "Ex", "estimate": 31.0e9}, {"name": "a0", "estimate": None}]
    frame = Table(rows).to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame["name"]) == ["Ex", "a0"]
    assert frame["estimate"][0] == 31.0e9
    assert np.isnan(frame["estimate"][1])
