"""What is made from code is what the code makes now: `python -m tools.reference`."""

from __future__ import annotations

import re
import tomllib

import pytest

from modalbase.client.connection import Connection
from modalbase.client.rest import Rest
from modalbase.client.routes import ROUTES
from tools import reference, routes, tolerances


@pytest.mark.parametrize("name", list(reference.MADE))
def test_what_is_made_from_code_is_up_to_date(name: str) -> None:
    assert (reference.ROOT / name).read_text() == reference.MADE[name](), "run python -m tools.reference"


def test_every_number_that_the_core_decides_by_has_its_meaning_beside_it() -> None:
    found = tolerances.constants()
    assert len(found) > 300
    assert [f"{one.module}.{one.name}" for one in found if not one.meaning] == []


def test_every_route_of_the_openapi_document_is_a_method_of_the_client() -> None:
    document = routes.document()
    asked = [
        given for path in document["paths"].values() for how in path.values() for given in how.get("parameters", ())
    ]
    assert {given["schema"]["default"] for given in asked if given["name"] == "limit"} == {
        20,
        100,
    }  # 20 of what is long
    found = {(one.method, one.path) for one in routes.described(document)}
    assert found == {(route.method, route.path) for route in ROUTES.values()}
    assert len(found) == len(ROUTES) > 80
    with Connection("http://127.0.0.1:1", "key") as nobody:
        rest = Rest(nobody)
        for name, route in ROUTES.items():
            assert route.summary in (getattr(rest, name).__doc__ or "")
        assert set(ROUTES) <= set(dir(rest))
        with pytest.raises(TypeError, match=r"takes campaign_id and got 0"):
            rest.get_campaign()
        with pytest.raises(TypeError, match=r"has no colour"):
            rest.list_projects(colour="red")
        with pytest.raises(AttributeError, match="no call 'nonsense'"):
            _ = rest.nonsense


def test_every_library_that_is_installed_has_its_licence_listed() -> None:
    project = tomllib.loads((reference.ROOT / "pyproject.toml").read_text())["project"]
    wanted = [
        *project["dependencies"],
        *(one for name in ("server", "mat73") for one in project["optional-dependencies"][name]),
    ]
    page = (reference.ROOT / "docs" / "licences.md").read_text()
    assert re.findall(r"^\| ([\w-]+) \| .+ \| `", page, flags=re.MULTILINE) == [
        re.split(r"[^\w-]", one)[0] for one in wanted
    ]
