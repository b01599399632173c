"""What is made from code is what the code makes now: `python -m tools.reference`."""

import ast
import itertools
import re
import tomllib
from collections.abc import Iterator

import pytest

from modalbase.client.connection import Connection
from modalbase.client.rest import Rest
from modalbase.client.rest import routes as calls
from tools import reference


@pytest.mark.parametrize("name", list(reference.MADE))
def test_what_is_made_from_code_is_up_to_date(name: str) -> None:
    assert (reference.ROOT / name).read_text() == reference.MADE[name](), "run python -m tools.reference"


def constants() -> Iterator[tuple[str, bool]]:
    """Every numeric constant of the core, and whether a comment or docstring beside it says what it means."""
    for path in sorted((reference.ROOT / "fecore").rglob("*.py")):
        lines, body = path.read_text().splitlines(), ast.parse(path.read_text()).body
        for node, after in itertools.zip_longest(body, body[1:]):
            target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
            if (
                isinstance(target, ast.Name)
                and re.fullmatch(r"_?[A-Z][A-Z0-9_]*", target.id)
                and of_numbers(node.value)
            ):
                own, above = lines[node.lineno - 1 : node.end_lineno], lines[node.lineno - 2]
                docstring = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
                yield f"{path.name}: {target.id}", docstring or "#" in "".join(own) or above.startswith("#")


def of_numbers(value: ast.expr) -> bool:
    parts = list(ast.walk(value))
    leaves = [part.value for part in parts if isinstance(part, ast.Constant)]
    other = any(isinstance(part, ast.Call | ast.Subscript | ast.Attribute) for part in parts)
    return bool(leaves) and all(isinstance(leaf, int | float) for leaf in leaves) and not other


def made_of_numbers(value: ast.expr) -> bool:
    parts = list(ast.walk(value))
    leaves = [part.value for part in parts if isinstance(part, ast.Constant)]
    other = any(isinstance(part, ast.Call | ast.Subscript | ast.Attribute) for part in parts)
    return bool(leaves) and all(isinstance(leaf, int | float) for leaf in leaves) and not other


def test_every_number_that_the_core_decides_by_has_its_meaning_beside_it() -> None:
    found = list(constants())
    assert len(found) > 100
    assert [name for name, stated in found if not stated] == []


def test_every_route_of_the_openapi_document_is_a_method_of_the_client() -> None:
    document = reference.document()
    asked = [
        given for path in document["paths"].values() for how in path.values() for given in how.get("parameters", ())
    ]
    assert {given["schema"]["default"] for given in asked if given["name"] == "limit"} == {
        20,
        100,
    }  # 20 of what is long
    found = {(one.method, one.path) for one in reference.described(document)}
    assert found == {(route.method, route.path) for route in calls().values()}
    assert len(found) == len(calls()) > 80
    with Connection("http://127.0.0.1:1", "key") as nobody:
        rest = Rest(nobody)
        for name, route in calls().items():
            assert route.summary in (getattr(rest, name).__doc__ or "")
        assert set(calls()) <= set(dir(rest))
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
