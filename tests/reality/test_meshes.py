"""Meshes as laboratories send them: groups of Universal Files, and the edges of Salome's quadratic
meshes.
"""

from collections.abc import Sequence

import pytest

from service.platform.errors import Invalid
from tests.support.imported import imported
from tests.support.lengths import long
from tests.support.places import shared_file

PLATE = {"thickness_m": 0.004, "isotropic": {"E_Pa": 7e10, "nu": 0.3, "density_kg_m3": 2700.0}}
HELD = {"held_dofs": [1, 2, 3, 4, 5, 6]}
SECTIONS = {"plate": PLATE, "clamp": HELD}


@pytest.mark.parametrize("name", ["mesh_groups_2467.unv", "mesh_salome_quadratic.unv"])
def test_groups_of_universal_files(name: str) -> None:
    content = shared_file("REALITY", "reality", name).read_bytes()
    model = imported(name, content, sections=SECTIONS)
    assert model.frequencies(3)[0] == pytest.approx(20.56, rel=0.015)
    assert [(one["name"], one["elements"]) for one in model.document["sets"]] == [("plate", 16)]
    assert not model.document["ignored"]


SHELLS, LINES = range(3, 7), (1, 2)


def group(number: int, name: str, members: Sequence[tuple[int, int]], width: int = 4) -> str:
    rows = ["".join(f"{value:10d}" for value in (number, 0, 0, 0, 0, 0, 0, len(members))), name]
    per = 8 // width
    for at in range(0, len(members), per):
        rows.append(
            "".join(
                "".join(f"{v:10d}" for v in (*m, *[0] * (width - 2)))
                for m in members[at : at + per]
            )
        )
    return "".join(f"{row}\n" for row in rows)


def unv(*groups: str, kind: str = "2467", edge: int = 21, scale: float = 1.0) -> str:
    """A strip of four quadrilaterals along x with two lines at its clamped end, mm."""
    nodes = [(50.0 * i * scale, 25.0 * j * scale) for j in range(3) for i in range(3)]
    rows = ["    -1", "  2411"]
    for number, (x, y) in enumerate(nodes, start=1):
        rows += [f"{number:10d}{1:10d}{1:10d}{11:10d}", f"{x:25.16E}{y:25.16E}{0.0:25.16E}"]
    rows += ["    -1", "    -1", "  2412"]
    for number, ends in zip(LINES, ((1, 4), (4, 7)), strict=True):
        rows += [
            f"{number:10d}{edge:10d}{2:10d}{1:10d}{7:10d}{2:10d}",
            f"{0:10d}{1:10d}{1:10d}",
            "{:10d}{:10d}".format(*ends),
        ]
    for number, first in zip(SHELLS, (1, 2, 4, 5), strict=True):
        rows.append(f"{number:10d}{44:10d}{2:10d}{1:10d}{7:10d}{4:10d}")
        rows.append("".join(f"{node:10d}" for node in (first, first + 1, first + 4, first + 3)))
    text = "".join(f"{row}\n" for row in [*rows, "    -1"])
    return text + (f"    -1\n{kind:>6}\n{''.join(groups)}    -1\n" if groups else "")


EDGE = group(1, "CLAMP", [(8, k) for k in LINES])
SHELL = group(2, "PLATE", [(8, k) for k in SHELLS])


@pytest.mark.parametrize("kind", ["2435", long("2452"), "2467", long("2477")])
@pytest.mark.parametrize("edge", [11, long(21), long(22)])
def test_kinds_of_groups(kind: str, edge: int) -> None:
    plain = imported("a.unv", unv(), sections={"set_2": PLATE, "line_2": HELD}).frequencies(3)
    found = imported(
        "a.unv", unv(EDGE, SHELL, kind=kind, edge=edge), sections=SECTIONS
    ).frequencies(3)
    assert found.tolist() == plain.tolist()


def test_older_groups_have_two_numbers_a_member() -> None:
    groups = [
        group(k, name, [(8, n) for n in own], 2)
        for k, (name, own) in enumerate([("CLAMP", LINES), ("P", SHELLS)])
    ]
    model = imported("a.unv", unv(*groups, kind="2430"), sections={"p": PLATE, "clamp": HELD})
    assert model.document["sets"][0]["elements"] == 4


def test_groups_of_nodes_and_of_both() -> None:
    first = imported("a.unv", unv(EDGE, SHELL), sections=SECTIONS).frequencies(3)
    nodes = group(1, "CLAMP", [(7, 1), (7, 4), (7, 7)])
    with pytest.raises(Invalid, match=r"line_2 would be left out \(2 lines; .*accept=LINE_2"):
        imported("a.unv", unv(nodes, SHELL), sections=SECTIONS)
    held = imported("a.unv", unv(nodes, SHELL), sections=SECTIONS, accept=["line_2"])
    assert held.frequencies(3).tolist() == first.tolist()
    both = group(1, "Clamp", [(7, 1), (8, 2)])
    lone = imported("a.unv", unv(both, SHELL), sections=SECTIONS, accept=["line_2"])
    assert lone.frequencies(3).tolist() == first.tolist()


def test_groups_that_overlap() -> None:
    every = group(3, "ALL", [(8, k) for k in (*LINES, *SHELLS)])
    model = imported("a.unv", unv(EDGE, SHELL, every), sections=SECTIONS)
    assert [one["name"] for one in model.document["sets"]] == ["plate"]
    with pytest.raises(
        Invalid, match=r"sections/all: element 3 is in plate and all; state the section of one"
    ):
        imported("a.unv", unv(EDGE, SHELL, every), sections={**SECTIONS, "all": PLATE})
    with pytest.raises(Invalid, match=r"element 3 is in plate and set_2"):
        imported("a.unv", unv(EDGE, SHELL), sections={**SECTIONS, "set_2": PLATE})
    halves = [
        group(k, name, [(8, n) for n in own])
        for k, (name, own) in enumerate([("A", (3, 5)), ("B b", (4, 6))], 2)
    ]
    parts = imported(
        "a.unv", unv(EDGE, *halves), sections={"a": PLATE, "b_b": PLATE, "clamp": HELD}
    )
    assert [(one["name"], one["elements"]) for one in parts.document["sets"]] == [
        ("a", 2),
        ("b_b", 2),
    ]


@pytest.mark.parametrize(
    ("groups", "said"),
    [
        ((EDGE, SHELL), r"lack plate \(4 elements\)"),
        (
            (group(1, "CLAMP", [(8, 99)]),),
            "line 1: the group clamp has the element 99, which is not there",
        ),
        ((group(1, "CLAMP", [(7, 99)]),), "the group clamp has the node 99, which is not there"),
        (
            (EDGE, group(2, "clamp", [(8, 3)])),
            r"dataset 3 \(set 2467\) line 4: clamp is there twice",
        ),
        ((EDGE.rpartition("         8")[0] + "\n",), "dataset 3 .set 2467. line 3"),
    ],
)
def test_what_is_wrong_with_groups(groups: Sequence[str], said: str) -> None:
    with pytest.raises(Invalid, match=said):
        imported("a.unv", unv(*groups), sections={})


def test_a_mesh_of_unusual_size_is_asked_about() -> None:
    large = unv(EDGE, SHELL, scale=1e3)
    with pytest.raises(
        Invalid,
        match=r"1.12e\+05 m large, usual is 0.001 to 10000 \(are the units right\?\); accept=size",
    ):
        imported("a.unv", large, "m-N-kg", sections=SECTIONS)
    assert imported("a.unv", large, "m-N-kg", sections=SECTIONS, accept=["size"]).document["sets"]
