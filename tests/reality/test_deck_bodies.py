"""Decks whose geometry was read wrongly: closed sections, offsets, sharp edges, layers; and tubes
of flat facets.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fecore.body.structure import Structure
from fecore.updating.forecasts import ForecastOrder, forecast
from modalbase.formats.models.units import in_si
from service.compute.models.bodies import body_of_model
from service.compute.models.reading import parsed
from tests.support.bodies import hz
from tests.support.lengths import long
from tests.support.places import shared_file


def body_of(
    content: bytes, name: str, units: str = "mm-N-t", boundary: str = "as_modelled"
) -> Structure:
    """The body of a deck as the service makes it."""
    return body_of_model(in_si(parsed(content, name), units), boundary)


def deck(name: str) -> bytes:
    return shared_file("REALITY", "reality", name).read_bytes()


def forecasts_find_their_points(body: Structure) -> None:
    """Its own, and the same places stated by somebody."""
    own = forecast(body, ForecastOrder(modes=3))
    stated = forecast(body, ForecastOrder(modes=3, places=own.places))
    np.testing.assert_allclose(stated.frequency_hz, own.frequency_hz)
    np.testing.assert_allclose(
        np.abs(stated.seen.max(axis=1)), np.abs(own.seen.max(axis=1)), rtol=0.2
    )


def test_a_channel_stated_as_a_box() -> None:
    found = hz(body_of(deck("deck_channel_as_box.inp"), "a.inp"), 3)
    np.testing.assert_allclose(found[:2], (18.01, 45.35), rtol=0.01)
    assert found[2] == pytest.approx(61.6, rel=0.01)


@pytest.mark.parametrize("place", range(2, 6))
def test_whichever_wall_of_the_box_is_missing(place: int) -> None:
    """J of three walls is Σ b t³/3, so torsion is 60 Hz or so and never 5."""
    lines = deck("deck_channel_as_box.inp").decode().splitlines()
    at = next(k for k, line in enumerate(lines) if "SECTION=BOX" in line) + 1
    sizes = ["30.", "60.", "4.", "4.", "4.", "4."]
    sizes[place] = "0.0001"
    lines[at] = ", ".join(sizes)
    assert hz(body_of("\n".join(lines).encode(), "a.inp"), 1)[0] > 14


def test_flats_with_offsets_in_their_own_thickness() -> None:
    body = body_of(deck("deck_rect_offsets.inp"), "a.inp")
    np.testing.assert_allclose(hz(body, 2), (31.78, 87.91), rtol=0.005)
    forecasts_find_their_points(body)


@pytest.mark.parametrize(
    "name", ["deck_stiffener_cquad4_zoffs.bdf", long("deck_stiffener_pshell_zoffs.bdf")]
)
def test_a_plate_that_stands_beside_its_nodes(name: str) -> None:
    body = body_of(deck(name), name)
    assert hz(body, 1)[0] == pytest.approx(37.13, rel=0.005)
    forecasts_find_their_points(body)


@pytest.mark.parametrize("offset", ["-8. ", "-4.5", "1.  ", "10. "])
@pytest.mark.parametrize(
    "name", ["deck_stiffener_cquad4_zoffs.bdf", "deck_stiffener_pshell_zoffs.bdf"]
)
def test_points_on_either_side_of_an_offset(name: str, offset: str) -> None:
    """On the nodes, on both faces of the wall, and no further than 2 mm beyond what lies
    between.
    """
    body = body_of(deck(name).replace(b"4.5 ", offset.encode()), name, boundary="free")
    x, reach = np.array([0.21, 0.013]), 0.002
    heights = 1e-3 * np.array([0.0, *(float(offset) + beside for beside in (-1.5, 0, 1.5))])
    seen = body.model.observe(
        np.column_stack([np.tile(x, (4, 1)), heights]), np.tile([1.0, 0, 0], (4, 1))
    )
    turned = np.array(seen @ body.model.motions[:, 4])  # about y
    np.testing.assert_allclose(np.diff(turned), np.diff(heights), atol=1e-12)
    for height in (heights.min() - 1.1 * reach, max(heights.max(), 0.006) + 1.1 * reach):
        place = np.array([[*x, height]])
        assert body.surfaces.are_off(place, body.surfaces.nearest(place)).all()


def test_a_trailing_edge() -> None:
    body = body_of(deck("deck_trailing_edge.inp"), "a.inp")
    plain = hz(replace(body, with_joints=False), 2)
    np.testing.assert_allclose(plain, (149.3, 595.9), rtol=0.01)
    np.testing.assert_allclose(hz(body, 2) / plain, (1.0098, 1.003), atol=2e-3)
    # A turn of 170° is 11.4 right angles' worth, of which little is left: stated is as much of the
    # joints' own error.
    assert body.model_error == pytest.approx(0.0045 * np.tan(np.radians(85)), rel=0.01)


@pytest.mark.parametrize("thickness", ["6.0", long("1.0")])
def test_a_trailing_edge_of_other_skins(thickness: str) -> None:
    content = deck("deck_trailing_edge.inp").replace(b"\n3.0\n", f"\n{thickness}\n".encode())
    body = body_of(content, "a.inp")
    ratio = hz(body, 2) / hz(replace(body, with_joints=False), 2)
    assert (np.abs(ratio - 1) < 0.05 * float(thickness)).all()


def test_two_layers_on_the_same_nodes() -> None:
    body = body_of(deck("deck_two_layers.inp"), "a.inp")
    assert 17.81 < hz(body, 1)[0] < 18.30
    assert (body.junctions, body.model_error) == ((), 0.0)


def test_layers_of_which_one_is_of_triangles_and_a_third() -> None:
    """Stiffness is the sum of layers in the same middle plane: f² goes with Σ t³ over Σ t."""
    lines = deck("deck_two_layers.inp").decode().splitlines()
    at = lines.index("*ELEMENT, TYPE=S4, ELSET=L2")
    quads = [[int(n) for n in line.split(",")] for line in lines[at + 1 : at + 17]]
    third = [f"{100 + n}, {a}, {b}, {c}, {d}" for n, a, b, c, d in quads]
    halves = [
        row
        for n, a, b, c, d in quads
        for row in (f"{n}, {a}, {b}, {c}", f"{n + 200}, {a}, {c}, {d}")
    ]
    section = ["*SHELL SECTION, ELSET=L3, MATERIAL=AL", "1.0"]
    elements = ["*ELEMENT, TYPE=S3, ELSET=L2", *halves, "*ELEMENT, TYPE=S4, ELSET=L3", *third]
    split = [*lines[:at], *elements, *lines[at + 17 :]]
    where = split.index("*BOUNDARY")
    more = [*split[:where], *section, *split[where:]]
    body = body_of("\n".join(more).encode(), "a.inp")
    two = hz(body_of("\n".join(lines).encode(), "a.inp"), 1)[0]
    assert body.junctions == ()
    assert hz(body, 1)[0] / two == pytest.approx(
        np.sqrt((64 + 8 + 1) / 7 / ((64 + 8) / 6)), rel=0.02
    )


def test_a_wedge_of_three_walls() -> None:
    body = body_of(deck("deck_wedge.inp"), "a.inp")
    assert hz(body, 1)[0] == pytest.approx(34.57, rel=0.015)
    assert hz(replace(body, with_joints=False), 1)[0] == pytest.approx(34.57, rel=0.015)


def test_a_coarse_tube_keeps_its_ovalling_modes() -> None:
    path = shared_file("BLIND_OPEN", "blind-open", "tube/truth.json")
    truth = json.loads(path.read_text())
    printed = next(f for name, f in truth.items() if name.startswith("tube-16.inp"))
    fine = next(f for name, f in truth.items() if name.startswith("64"))
    square, curved = (
        hz(body_of(Path(path.parent, name).read_bytes(), name, "m-N-kg", "free"), 6)
        for name in ("tube-16.inp", "tube-16-s8r.inp")
    )
    np.testing.assert_allclose(square, printed[:6], rtol=0.05)
    np.testing.assert_allclose(curved, fine[:6], rtol=0.03)
