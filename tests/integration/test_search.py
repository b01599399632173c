"""Search over HTTP: filters over several nouns, order and pages, words, files; what others have is
not even counted.
"""

import csv
import io
import json
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import httpx
import nanoarrow as na
import pytest
from hypothesis import strategies as st

import modalbase
from modalbase.client.errors import ClientError
from service.app import composition
from service.app.supervisor import LocalService
from service.nouns.search.nouns import NOUNS, SEARCHED
from tests.support.command import modalbase_here
from tests.support.furnished import frfs
from tests.support.laboratory import BEAM
from tests.support.lengths import STRANGE, fuzz, long
from tests.support.rest import every_page, ok
from tests.support.tables import parquet_rows

assert composition.ROUTERS  # so that every table is known


@pytest.fixture
def bridge(api: httpx.Client, project: str) -> dict[str, str]:
    """Two structures: campaigns of the first are warm and free, or cold and clamped; the second's
    one is warm and clamped.
    """
    ids = {"project": project}
    for name in ("bridge north", "panel"):
        ids[name] = ok(
            api.post(f"projects/{project}/structures", json={**BEAM, "name": name}), 201
        )["id"]
    stated = [
        ("bridge north", "warm", "free", 28.0, "2026-03-02T09:30:00Z", "8206-002", [25.0, 60.0]),
        (
            "bridge north",
            "cold",
            "cantilever",
            -3.5,
            "2026-03-31T23:59:59Z",
            "086C03",
            [26.5, 70.0],
        ),
        ("panel", "late", "cantilever", 31.0, "2026-04-01T00:00:00Z", "086C03", [80.0]),
        ("panel", "unknown", "free", None, None, "086C03", []),
    ]
    for structure, name, boundary, temperature, at, hammer, frequencies in stated:
        body = {
            "name": name,
            "boundary": boundary,
            "temperature_c": temperature,
            "performed_at": at,
        }
        body["instruments"] = {"hammer": {"model": hammer}}
        if temperature is not None:
            body["covariates"] = {"wind_m_s": temperature / 10, "temperature_c": temperature}
            del body["temperature_c"]
        ids[name] = ok(api.post(f"structures/{ids[structure]}/campaigns", json=body), 201)["id"]
        modes = [{"frequency_hz": f, "damping_ratio": f / 500} for f in frequencies]
        if modes:
            ok(
                api.post(
                    f"campaigns/{ids[name]}/mode-sets", json={"name": "typed", "modes": modes}
                ),
                201,
            )
    return ids


def names(api: httpx.Client, noun: str, text: str, **more: Any) -> list[str]:
    field = {"modes": "campaign.name"}.get(noun, "name")
    body = ok(api.get(f"search/{noun}", params={"filter": text, "fields": field, **more}), 200)
    return [row[field] for row in body["items"]]


def test_every_field_is_a_column() -> None:
    for noun in NOUNS.values():
        table = noun.rows()
        for field in noun.fields:
            assert field.of(table) is not None
            assert (
                field.nullable or field.value or not table.c[field.column or field.name].nullable
            ), field.name
        assert all(name in table.c for name in noun.key)


QUESTIONS = [
    ("campaigns", "campaign.temperature_c > 25 AND structure.name LIKE 'bridge%'", ["warm"]),
    ("campaigns", "temperature_c > 25", ["warm", "late"]),
    ("campaigns", "NOT temperature_c > 25", ["cold"]),
    ("campaigns", "temperature_c IS NULL", ["unknown"]),
    ("campaigns", "temperature_c IS NOT NULL AND boundary <> 'free'", ["cold", "late"]),
    ("campaigns", "25 < temperature_c", ["warm", "late"]),
    ("campaigns", "temperature_c = -3.5", ["cold"]),
    ("campaigns", "covariates.wind_m_s > 2.5", ["warm", "late"]),
    ("campaigns", "covariates.wind_m_s IS NULL", ["unknown"]),
    ("campaigns", "covariates.temperature_c < 5", ["cold"]),
    ("modes", "campaign.covariates.wind_m_s < 0", ["cold", "cold"]),
    ("campaigns", "boundary IN ('free', 'simply_supported')", ["warm", "unknown"]),
    ("campaigns", "boundary NOT IN ('free')", ["cold", "late"]),
    ("campaigns", "CASEI(boundary) = 'FREE'", ["warm", "unknown"]),
    ("campaigns", "boundary LIKE 'f%'", ["warm", "unknown"]),
    (
        "campaigns",
        "(boundary = 'free' OR temperature_c > 30) AND performed_at IS NOT NULL",
        ["warm", "late"],
    ),
    ("campaigns", "performed_at = DATE('2026-03-31')", ["cold"]),
    ("campaigns", "performed_at > DATE('2026-03-31')", ["late"]),
    ("campaigns", "performed_at <= DATE('2026-03-31')", ["warm", "cold"]),
    ("campaigns", "performed_at = TIMESTAMP('2026-04-01T00:00:00Z')", ["late"]),
    ("campaigns", "T_DURING(performed_at, INTERVAL('2026-03-01', '2026-03-31'))", ["warm", "cold"]),
    ("campaigns", "T_DURING(performed_at, INTERVAL('..', '2026-03-30'))", ["warm"]),
    ("campaigns", "T_AFTER(performed_at, DATE('2026-03-30'))", ["cold", "late"]),
    ("campaigns", "performed_at BETWEEN DATE('2026-03-02') AND DATE('2026-03-02')", ["warm"]),
    ("campaigns", "CASEI(structure.name) LIKE CASEI('BRIDGE%') AND hammer <> '8206-002'", ["cold"]),
    ("campaigns", "mode.frequency_hz BETWEEN 24 AND 27 AND mode.damping_ratio > 0.051", ["cold"]),
    ("campaigns", "mode.frequency_hz < 26 AND mode.damping_ratio > 0.1", []),  # two modes, not one
    ("structures", "campaign.temperature_c > 25 AND campaign.boundary = 'free'", ["bridge north"]),
    ("structures", "campaign.temperature_c > 25 AND campaign.boundary = 'cantilever'", ["panel"]),
    # the mode is the warm campaign's
    ("structures", "campaign.temperature_c < 0 AND mode.frequency_hz < 26", []),
    (
        "structures",
        "campaign.temperature_c > 30 OR mode.frequency_hz < 26",
        ["bridge north", "panel"],
    ),
    ("modes", "frequency_hz < 30 AND campaign.temperature_c < 0", ["cold"]),
]


def test_a_filter_finds(api: httpx.Client, bridge: dict[str, str]) -> None:
    for noun, text, expected in QUESTIONS:
        assert names(api, noun, f"({text}) AND project.id = '{bridge['project']}'") == expected, (
            text
        )


REFUSED = [
    ("campaign.temprature_c > 25", "campaign.temperature_c"),
    ("nonsense = 1", "campaign."),
    ("covariates.wind > 1", "there is no field 'covariates.wind'"),
    ("temperature_c > 'warm'", "expected a number in °C"),
    ("boundary = 'foo'", "never 'foo'; it is cantilever, free, simply_supported or as_modelled"),
    ("boundary = 'Free'", "never 'Free'"),
    ("boundary NOT IN ('free', 'clamped')", "never 'clamped'"),
    ("CASEI(frf.quantity) = 'MASS'", "accelerance, mobility or receptance"),
    ("mode_set.origin <> 'guessed'", "typed, file, identified or edited"),
    ("name = 5", "expected a text in single quotes"),
    ("performed_at > 5", "expected DATE("),
    ("performed_at > DATE('2026-02-30')", "expected DATE("),
    ("frf.reference_point = 1.5", "expected a whole number"),
    ("frf.reference_point = 9223372036854775808", "expected a whole number"),
    ("frf.driving_point = 1", "expected TRUE or FALSE"),
    ("id = 'x'", "expected an id"),
    ("temperature_c > 1e999", "expected a number"),
    ("temperature_c > humidity_percent", "another field"),
    ("temperature_c + 1 > 2", "compares no field"),
    ("1 = 1", "compares no field"),
    ("name LIKE 'x\\'", "single \\"),
    ("S_INTERSECTS(name, POINT(1 2))", "S_INTERSECTS"),
    ("temperature_c >", "cannot be read, behind"),
    ("(" * 51 + "name = 'x'" + ")" * 51, "brackets"),
    ("NOT " * 60 + "name = 'x'", "levels"),
    ("name = '" + "x" * 2000 + "'", "at most 2000"),
    ("name = '\x01'", "control character"),
    ("5", "is no condition"),
]


def test_a_filter_that_cannot_be_is_refused_in_words(api: httpx.Client) -> None:
    for text, detail in REFUSED:
        body = ok_problem(api.get("search/campaigns", params={"filter": text}))
        assert detail in body["errors"][0]["detail"], text
        assert body["errors"][0]["pointer"] == "filter"


def ok_problem(answer: httpx.Response) -> dict[str, Any]:
    assert answer.status_code == 422, answer.text
    body: dict[str, Any] = answer.json()
    return body


def test_pages_in_any_order_hold_each_row_once(api: httpx.Client, bridge: dict[str, str]) -> None:
    for sort in (
        "name",
        "-name",
        "temperature_c",
        "-temperature_c",
        "-performed_at",
        "structure.name",
        None,
    ):
        require_pages(api, bridge, sort)


def require_pages(api: httpx.Client, bridge: dict[str, str], sort: str | None) -> None:
    query: dict[str, Any] = {"filter": f"project.id = '{bridge['project']}'"} | (
        {"sort": sort} if sort else {}
    )
    whole = ok(api.get("search/campaigns", params=query), 200)
    assert (whole["count"], whole["more"], whole["next_cursor"]) == (4, False, None)
    assert whole["facets"] == {
        "boundary": {"cantilever": 2, "free": 2},
        "structure.name": {"bridge north": 2, "panel": 2},
    }
    paged = every_page(api, "search/campaigns", query | {"limit": 1})
    assert paged == whole["items"]
    if sort:
        values = [row[sort.removeprefix("-")] for row in paged]
        known = [value for value in values if value is not None]
        assert known == sorted(known, reverse=sort.startswith("-"))
        assert values[len(known) :] == [None] * (len(values) - len(known))  # the unknown come last


def test_a_strange_cursor_is_refused(api: httpx.Client) -> None:
    cursors = (
        "x",
        "W10",
        "WzFd",
        "WyIyMDI2LTAzLTAxIiwgbnVsbF0",
        "e30",
        "/" * 30,
        "WyJcdWQ4MDAiLCAieCJd",
    )
    for sort, cursor in product(("performed_at", "name"), cursors):
        ok_problem(api.get("search/campaigns", params={"cursor": cursor, "sort": sort}))


def test_words_are_looked_for_in_names_notes_and_instruments(
    api: httpx.Client, bridge: dict[str, str]
) -> None:
    mine = f"project.id = '{bridge['project']}'"
    assert names(api, "campaigns", mine, q="086c03") == ["cold", "late", "unknown"]
    assert names(api, "campaigns", mine, q="Bridge 086C03") == ["cold"]
    assert names(api, "structures", mine, q="north") == ["bridge north"]
    assert names(api, "modes", mine, q="warm") == ["warm", "warm"]
    assert names(api, "campaigns", mine, q="' & | !( :*") == []
    assert (
        "21 words"
        in ok_problem(api.get("search/campaigns", params={"q": "a " * 21}))["errors"][0]["detail"]
    )


def test_files_have_all_rows(api: httpx.Client, bridge: dict[str, str]) -> None:
    query = {"filter": f"project.id = '{bridge['project']}'", "sort": "-temperature_c"}
    rows = ok(api.get("search/campaigns", params={**query, "limit": 100}), 200)["items"]
    text = api.get("search/campaigns", params={**query, "format": "csv"}).text
    assert list(csv.DictReader(io.StringIO(text))) == [
        {name: "" if value is None else str(value) for name, value in row.items()} for row in rows
    ]
    lines = api.get("search/campaigns", params={**query, "format": "jsonl"}).text.splitlines()
    assert [json.loads(line) for line in lines] == rows
    answer = api.get(
        "search/campaigns", params=query, headers={"Accept": "application/vnd.apache.arrow.stream"}
    )
    table = na.ArrayStream.from_readable(io.BytesIO(answer.content)).read_all()
    assert [row["name"] for row in table.to_pylist()] == [row["name"] for row in rows]
    assert [row["temperature_c"] for row in table.to_pylist()] == [
        row["temperature_c"] for row in rows
    ]
    assert table.to_pylist()[0]["performed_at"].isoformat() == "2026-04-01T00:00:00+00:00"
    content = api.get("search/campaigns", params={**query, "format": "parquet"}).content
    assert parquet_rows(content) == table.to_pylist()
    for noun in SEARCHED:  # columns without rows, of every type
        nothing = {"q": "nowhere", "format": "arrow"}
        stream = io.BytesIO(api.get(f"search/{noun}", params=nothing).content)
        empty = na.ArrayStream.from_readable(stream).read_all()
        assert any(field.name.endswith("id") for field in empty.schema.fields)
        content = api.get(f"search/{noun}", params={**nothing, "format": "parquet"}).content
        assert parquet_rows(content) == empty.to_pylist() == []


def test_what_others_have_is_neither_found_nor_counted(
    bridge: dict[str, str], new_client: Callable[[], httpx.Client]
) -> None:
    stranger = new_client()
    for noun in SEARCHED:
        body = ok(stranger.get(f"search/{noun}"), 200)
        assert (body["items"], body["count"]) == ([], 0)
        assert not any(body["facets"].values())
        assert ok(stranger.get(f"search/{noun}", params={"q": "bridge"}), 200)["count"] == 0
    own = ok(stranger.post("projects", json={"name": "own"}), 201)["id"]
    ok(stranger.post(f"projects/{own}/structures", json=BEAM), 201)
    assert (
        names(stranger, "structures", "campaign.temperature_c > -300 OR mode.frequency_hz > 0")
        == []
    )
    assert names(stranger, "structures", f"project.id = '{bridge['project']}'") == []


def test_what_is_deleted_is_not_found(api: httpx.Client, bridge: dict[str, str]) -> None:
    mine = f" AND project.id = '{bridge['project']}'"
    etag = api.get(f"campaigns/{bridge['warm']}").headers["ETag"]
    ok(api.delete(f"campaigns/{bridge['warm']}", headers={"If-Match": etag}), 204)
    assert (
        names(api, "structures", "campaign.boundary = 'free' AND name LIKE 'bridge%'" + mine) == []
    )
    assert names(api, "modes", "frequency_hz < 26" + mine) == []


_NAMES = [f"{noun.name}.{field.name}" for noun in NOUNS.values() for field in noun.fields]
_NAMES += ["tag", "meta.client", "frf.meta.a.b", "campaign.meta.a"]
_OPERATORS = (
    "AND OR NOT IN LIKE BETWEEN IS NULL ( ) , = <> < <= > >= + - * / ^ % DIV T_DURING( CASEI("
    " A_CONTAINS("
)
_VALUES = (
    "'a%' '\\' '' 12 -1.5 1e308 99999999999999999999 TRUE DATE('2026-03-01') DATE('9999-12-31')"
    " INTERVAL('..','..')"
)
_STRANGE = ["nothing", '"', "'", "ü", "\x00", "POINT(1 2)", "TIMESTAMP('9999-12-31T23:59:59Z')"]
_WORDS = st.sampled_from([*_NAMES, *_OPERATORS.split(), *_VALUES.split(), *_STRANGE])
_LEAVES = st.builds(
    "{} {} {}".format,
    st.sampled_from(_NAMES),
    st.sampled_from(["=", "<>", "<", ">=", "LIKE", "IN", "NOT IN"]),
    st.sampled_from(
        [
            "1",
            "'a'",
            "('a', 'b')",
            "(1, 2)",
            "DATE('2026-03-01')",
            "TRUE",
            "-1e300",
            "'%'",
            "('2026-03-01')",
        ]
    ),
)
_FILTERS = st.recursive(
    _LEAVES,
    lambda inner: st.one_of(
        st.builds("({} AND {})".format, inner, inner),
        st.builds("({} OR {})".format, inner, inner),
        st.builds("NOT {}".format, inner),
    ),
    max_leaves=8,
)


@pytest.mark.parametrize("examples", [30, long(300)])
def test_no_filter_is_an_error_of_the_service(api: httpx.Client, examples: int) -> None:
    texts = st.one_of(
        _FILTERS, st.lists(_WORDS, max_size=25).map(" ".join), st.text(STRANGE, max_size=60)
    )

    def ask(asked: tuple[str, str]) -> None:
        noun, text = asked
        answer = api.get(f"search/{noun}", params={"filter": text, "limit": 1})
        assert answer.status_code in (200, 422)

    fuzz(examples, st.tuples(st.sampled_from(sorted(SEARCHED)), texts), ask)


def test_spectra_of_one_campaign_are_written_as_uff(
    api: httpx.Client, bridge: dict[str, str]
) -> None:
    for name in ("warm", "cold"):
        ok(api.post(f"campaigns/{bridge[name]}/frfs", json=frfs(12)), 201)
    one = {"filter": f"campaign.id = '{bridge['warm']}'", "format": "uff"}
    whole = api.get(f"campaigns/{bridge['warm']}/frfs/data", params={"format": "uff"})
    assert api.get("search/frfs/data", params=one).content == whole.content
    both = {"filter": f"structure.id = '{bridge['bridge north']}'", "format": "uff"}
    assert "of 2" in ok_problem(api.get("search/frfs/data", params=both))["errors"][0]["detail"]


def test_any_field_can_be_a_facet(api: httpx.Client, bridge: dict[str, str]) -> None:
    query = {
        "filter": f"project.id = '{bridge['project']}'",
        "facets": "hammer,temperature_c,structure.tag",
    }
    facets = ok(api.get("search/campaigns", params=query), 200)["facets"]
    assert facets["hammer"] == {"086C03": 3, "8206-002": 1}
    assert facets["temperature_c"] == {"": 1, "-3.5": 1, "28.0": 1, "31.0": 1}
    assert facets["structure.tag"] == {}
    assert ok(api.get("search/campaigns", params={**query, "facets": "tag"}), 200)["count"] == 4
    many = ok_problem(api.get("search/campaigns", params={"facets": ",".join(_NAMES[6:20])}))
    assert many["errors"][0]["pointer"] == "facets"


def test_a_search_is_kept_for_a_project(
    api: httpx.Client, bridge: dict[str, str], new_client: Callable[[], httpx.Client]
) -> None:
    body = {
        "project": bridge["project"],
        "name": "warm",
        "noun": "campaigns",
        "filter": "temperature_c > 25",
    }
    kept = ok(api.post("searches", json={**body, "sort": "-temperature_c"}), 201)
    assert kept["query"] == {"filter": "temperature_c > 25", "sort": "-temperature_c"}
    assert kept in ok(api.get("searches", params={"limit": 1000}), 200)["items"]
    ok(api.post("searches", json=body), 409)
    for wrong, pointer in (
        ({"filter": "temprature_c > 25"}, "/filter"),
        ({"noun": "bridges"}, "/noun"),
        ({"fields": "x"}, "/fields"),
        ({"project": bridge["warm"]}, "/project"),
    ):
        assert (
            ok_problem(api.post("searches", json=body | wrong))["errors"][0]["pointer"] == pointer
        )
    stranger = new_client()
    assert ok(stranger.get("searches"), 200)["items"] == []
    assert stranger.delete(f"searches/{kept['id']}").status_code == 404
    ok(api.delete(f"searches/{kept['id']}"), 204)
    ok(api.get(f"searches/{kept['id']}"), 404)


def test_the_library_fetches_what_is_asked_for(
    service: LocalService, api: httpx.Client, bridge: dict[str, str]
) -> None:
    key = api.headers["Authorization"].removeprefix("Bearer ")
    for name in ("warm", "cold"):
        ok(api.post(f"campaigns/{bridge[name]}/frfs", json=frfs(12)), 201)
    with modalbase.connect(service.url, key) as lab:
        rows = lab.find("campaigns", f"project.id = '{bridge['project']}'", sort="-temperature_c")
        assert (rows.count, rows.more, rows.facets["boundary"]) == (
            4,
            False,
            {"cantilever": 2, "free": 2},
        )
        assert [row["name"] for row in rows] == ["late", "warm", "cold", "unknown"]
        assert rows.head(1)[0]["name"] == "late"
        assert "4 campaigns" in repr(rows)
        table = rows.to_pandas()
        assert list(table["name"]) == ["late", "warm", "cold", "unknown"]
        assert table["performed_at"][1].isoformat() == "2026-03-02T09:30:00+00:00"
        arrays = lab.find("frfs", f"project.id = '{bridge['project']}'").arrays(fmin=2.0)
        assert arrays["values"].tolist() == [[2 + 0.5j, 3 + 1j]] * 2
        assert arrays["response_point"].tolist() == [12, 12]
        with pytest.raises(ClientError, match="have no spectra"):
            rows.arrays()
        with pytest.raises(ClientError, match="no field 'tmperature_c'"):
            assert lab.find("campaigns", "tmperature_c > 2").count
        nothing = lab.find("frfs", "lines > 1e6")
        assert (list(nothing), repr(nothing)) == ([], "0 frfs")


def test_the_command_lists_and_writes(
    service: LocalService, api: httpx.Client, bridge: dict[str, str], tmp_path: Path
) -> None:
    place = {
        "MODALBASE_URL": service.url,
        "MODALBASE_API_KEY": api.headers["Authorization"].removeprefix("Bearer "),
    }

    def run(*words: str) -> str:
        done = modalbase_here(*words, **place)
        assert done.returncode == 0, done.stderr
        return done.stdout

    mine = f"project.id = '{bridge['project']}'"
    listed = run(
        "find", "campaigns", mine, "--fields", "name,temperature_c", "--sort", "name", "--most", "3"
    )
    assert "cold" in listed
    assert "3 of 4" in listed
    assert "--most" not in run("find", "campaigns", mine)  # all four
    assert json.loads(run("find", "campaigns", mine, "--json"))["count"] == 4
    file = tmp_path / "found.csv"
    run("find", "campaigns", mine, "-q", "086C03", "--out", str(file))
    assert len(file.read_text(encoding="utf-8").splitlines()) == 4
