"""Sections, axes and offsets of Nastran's bars and beams, against closed forms."""

import numpy as np
import pytest
import scipy

from fecore.body import beams as core
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.structure import Structure
from fecore.body.supports import Support
from modalbase.formats.models.bdf import read_bdf
from modalbase.formats.models.model import BeamSection, FiniteElementModel
from modalbase.formats.models.shapes import NASTRAN
from tests.support.bodies import pencil
from tests.unit.formats.models.decks import ENDS


def read(text: str) -> FiniteElementModel:
    return read_bdf(text.encode())


def section(model: FiniteElementModel) -> BeamSection:
    (beam,) = model.sections.values()
    assert isinstance(beam, BeamSection)
    return beam


def test_plane_1_is_that_of_the_orientation_vector() -> None:
    """A cantilever along y, its plane 1 upright: I1 carries what moves along z."""
    count, length = 60, 3.0
    grids = "".join(f"GRID,{k + 1},,0.,{k * length / count:.6f},0.\n" for k in range(count + 1))
    bars = "".join(f"CBAR,{k + 1},1,{k + 1},{k + 2},0.,0.,1.\n" for k in range(count))
    model = read(
        grids + bars + "PBAR,1,1,6.-4,4.5-8,2.-8,3.-8\nMAT1,1,2.1+11,,.3,7850.\nSPC1,1,123456,1\n"
    )
    (block,), own, material = model.elements, section(model), model.materials["1"].constants
    held = {"root": model.supports[0].nodes}
    beam = core.BeamSection(
        material["E"], material["G"], material["density"], own.area, own.inertia, own.torsion,
        axis=tuple(block.axes[0]),
    )  # fmt: skip
    structure = Structure(
        Mesh(model.nodes, (CellBlock(block.kind, block.nodes, block.set),), held),
        {block.set: beam},
        supports=(Support("root"),),
    )
    K, M = pencil(structure)
    values, shapes = scipy.sparse.linalg.eigsh(K, 2, M, sigma=0, v0=np.ones(K.shape[0]))
    moved = np.abs(shapes[-6:]) / np.abs(shapes[-6:-3]).max(axis=0)  # the last node is the tip
    for omega, tip, second, axis in zip(
        np.sqrt(values), moved.T, (2e-8, 4.5e-8), (0, 2), strict=True
    ):
        euler = (1.8751040687 / length) ** 2 * np.sqrt(2.1e11 * second / (7850 * 6e-4))
        assert omega == pytest.approx(euler, rel=2e-3)  # sixty chords, and shear of a slender bar
        assert np.argmax(tip[:3]) == axis


def test_a_bar_states_its_section() -> None:
    model = read(
        ENDS + "CBAR,1,1,1,2,0.,0.,1.\nPBAR,1,1,6.-4,4.5-8,2.-8,3.-8,.7\n,,,,,,,,\n,.8,.7,1.-9"
    )
    beam = section(model)
    assert beam.inertia == (2e-8, 4.5e-8, 1e-9)
    assert (beam.area, beam.torsion, beam.extra_mass, beam.shear) == (
        6e-4,
        3e-8,
        0.7,
        (0.8, 0.7),
    )
    assert {name: place.start for name, place in beam.places.items()} == {
        "area": 9,
        "I2": 14,
        "I1": 20,
        "J": 25,
    }


def test_orientation_by_a_grid_or_a_default_and_offsets() -> None:
    far = "GRID,3,,0.,5.,0.\n"
    by_grid = read(ENDS + far + "CBAR,1,1,1,2,3\nPBAR,1,1,6.-4,4.5-8,2.-8,3.-8\n")
    assert by_grid.elements[0].axes[0] == pytest.approx([0, 5, 0])
    default = read(ENDS + "BAROR,,1,,,0.,1.,0.\nCBAR,1,,1,2\nPBAR,1,1,6.-4,4.5-8,2.-8,3.-8\n")
    assert default.elements[0].axes[0] == pytest.approx([0, 1, 0])
    off = read(ENDS + "CBEAM,1,1,1,2,0.,0.,1.\n,,,.0,.0,.1,.0,.0,.2\nPBEAML,1,1,,BAR\n,.02,.03\n")
    assert off.elements[0].offsets[0].tolist() == [[0, 0, 0.1], [0, 0, 0.2]]
    own = read(
        ENDS + "CBEAM,1,1,1,2,0.,0.,1.,GOO\n,,,.0,.1,.0,.0,.1,.0\nPBEAML,1,1,,BAR\n,.02,.03\n"
    )
    assert own.elements[0].offsets[0] == pytest.approx(np.array([[0, 0, 0.1], [0, 0, 0.1]]))
    # x is y, y is z
    turned = ENDS.replace("0.,0.,0.", "0.,0.,0.,5", 1) + "CORD2R,5,,0.,0.,0.,1.,0.,0.\n,0.,1.,0.\n"
    skew = read(
        turned + "CBAR,1,1,1,2,1.,0.,0.\n,,,.0,.1,.0,.0,.1,.0\nPBAR,1,1,6.-4,4.5-8,2.-8,3.-8\n"
    )
    assert skew.elements[0].axes[0] == pytest.approx([0, 1, 0])
    assert skew.elements[0].offsets[0] == pytest.approx(np.array([[0, 0, 0.1], [0, 0.1, 0]]))


def test_rods_bend_with_next_to_nothing() -> None:
    model = read(
        ENDS
        + "CONROD,1,1,2,1,2.-4,1.-9\nCROD,2,5,1,2\nPROD,5,1,3.-4\nCTUBE,3,6,1,2\nPTUBE,6,1,.02,.001\n"
    )
    assert [block.set for block in model.elements] == ["conrod_1", "prod_5", "ptube_6"]
    areas = [model.sections[block.set].area for block in model.elements]
    assert areas == pytest.approx([2e-4, 3e-4, np.pi * (0.01**2 - 0.009**2)])
    for block in model.elements:
        beam = model.sections[block.set]
        assert 0 < beam.inertia[0] < 1e-5 * beam.area**2
    assert {one.card: one.changes for one in model.ignored} == {
        "CONROD without I or J": False, "PROD without I or J": False, "PTUBE without I or J": False,
    }  # fmt: skip


def test_a_beam_with_stations() -> None:
    beam = ENDS + "CBEAM,1,1,1,2,0.,0.,1.\nPBEAM,1,1,{}"
    start = "1.-4,1.-8,2.-8,,3.-8,.5\n,.1,.1,.2,.2,.3,.3,.4,.4\n"
    even = section(read(beam.format(start + ",YES,1.\n,,,,,,,,\n,.8,.9,,,,,,\n,,,,,.01,.02\n")))
    assert (even.inertia, even.torsion, even.shear) == ((2e-8, 1e-8, 0.0), 3e-8, (0.8, 0.9))
    model = read(beam.format(start + ",NO,1.,3.-4,3.-8,4.-8,,5.-8,1.5\n"))
    assert section(model).area == pytest.approx(2e-4)
    assert section(model).extra_mass == pytest.approx(1.0)
    assert [one.changes for one in model.ignored if one.card == "PBEAM that tapers"] == [True]
    shifted = read(beam.format(start + ",YES,1.\n,,,,,,,,\n,,,,,,,,\n,,,,,.01,.02\n"))
    # axis 1 is z, axis 2 −y
    assert shifted.elements[0].offsets[0] == pytest.approx(np.tile([0, -0.02, 0.01], (2, 1)))


def by_points(kind: str, dimensions: list[float]) -> tuple[float, float, float, float]:
    """Area and moments of a section, counted on a raster of what the manual's figures show as
    solid.
    """
    size = 1000  # cells of 0.2 mm, of which every edge below is a multiple
    y, z = np.meshgrid(
        *(np.linspace(-0.1, 0.1, size, endpoint=False) + 0.1 / size,) * 2, indexing="ij"
    )
    inside = INSIDE[kind](np.round(y, 9), np.round(z, 9), *dimensions)
    cell = (0.2 / size) ** 2
    y, z = y[inside], z[inside]
    y, z = y - y.mean(), z - z.mean()
    return len(y) * cell, float(y @ y) * cell, float(z @ z) * cell, float(y @ z) * cell


def within(y, z, y0, y1, z0, z1):
    return (y > y0) & (y < y1) & (z > z0) & (z < z1)


INSIDE = {
    "ROD": lambda y, z, r: y**2 + z**2 < r**2,
    "TUBE": lambda y, z, r, i: (y**2 + z**2 < r**2) & (y**2 + z**2 > i**2),
    "TUBE2": lambda y, z, r, t: (y**2 + z**2 < r**2) & (y**2 + z**2 > (r - t) ** 2),
    "BAR": lambda y, z, w, h: within(y, z, -h / 2, h / 2, -w / 2, w / 2),
    "BOX": lambda y, z, w, h, t, s: (
        within(y, z, -h / 2, h / 2, -w / 2, w / 2)
        & ~within(y, z, t - h / 2, h / 2 - t, s - w / 2, w / 2 - s)
    ),
    "BOX1": lambda y, z, w, h, top, low, left, right: (
        within(y, z, 0, h, 0, w) & ~within(y, z, low, h - top, left, w - right)
    ),
    "I": lambda y, z, h, low, top, web, t0, t1: (
        within(y, z, 0, t0, -low / 2, low / 2)
        | within(y, z, 0, h, -web / 2, web / 2)
        | within(y, z, h - t1, h, -top / 2, top / 2)
    ),
    "I1": lambda y, z, over, web, clear, h: (
        within(y, z, -h / 2, h / 2, -(over + web) / 2, (over + web) / 2)
        & ~(within(y, z, -clear / 2, clear / 2, -1, 1) & (np.abs(z) > web / 2))
    ),
    "CHAN": lambda y, z, b, h, web, t: within(y, z, 0, h, 0, b) & ~within(y, z, t, h - t, web, 1),
    "CHAN1": lambda y, z, b, web, clear, h: (
        within(y, z, -h / 2, h / 2, 0, b + web) & ~within(y, z, -clear / 2, clear / 2, web, 1)
    ),
    "CHAN2": lambda y, z, leg, web, h, b: (
        within(y, z, 0, h, 0, b) & ~within(y, z, web, 1, leg, b - leg)
    ),
    "T": lambda y, z, b, h, t, web: (
        within(y, z, 0, h, -web / 2, web / 2) | within(y, z, h - t, h, -b / 2, b / 2)
    ),
    "T2": lambda y, z, b, h, t, web: (
        within(y, z, 0, h, -web / 2, web / 2) | within(y, z, 0, t, -b / 2, b / 2)
    ),
    "T1": lambda y, z, h, b, t, web: (
        within(y, z, -h / 2, h / 2, 0, t) | within(y, z, -web / 2, web / 2, -b, t)
    ),
    "CROSS": lambda y, z, arms, post, h, t: (
        within(y, z, -h / 2, h / 2, -post / 2, post / 2)
        | within(y, z, -t / 2, t / 2, -(arms + post) / 2, (arms + post) / 2)
    ),
    "H": lambda y, z, bar, legs, h, t: (
        within(y, z, -t / 2, t / 2, -bar / 2, bar / 2)
        | (within(y, z, -h / 2, h / 2, -(bar + legs) / 2, (bar + legs) / 2) & (np.abs(z) > bar / 2))
    ),
    "Z": lambda y, z, b, web, clear, h: (
        within(y, z, -h / 2, h / 2, -web / 2, web / 2)
        | within(y, z, clear / 2, h / 2, 0, b + web / 2)
        | within(y, z, -h / 2, -clear / 2, -b - web / 2, 0)
    ),
    "L": lambda y, z, b, h, t, web: within(y, z, 0, t, 0, b) | within(y, z, 0, h, 0, web),
    "HAT": lambda y, z, h, t, top, brim: (
        within(y, z, h - t, h, -top / 2, top / 2)
        | (within(y, z, 0, h, -top / 2, top / 2) & (np.abs(z) > top / 2 - t))
        | (within(y, z, 0, t, -top / 2 - brim, top / 2 + brim) & (np.abs(z) > top / 2 - t))
    ),
    "HEXA": lambda y, z, side, w, h: (
        (np.abs(y) < h / 2) & (np.abs(z) < w / 2 - side * np.abs(y) / (h / 2))
    ),
}
DIMENSIONS = {
    "ROD": [0.05], "TUBE": [0.05, 0.04], "TUBE2": [0.05, 0.01], "BAR": [0.02, 0.05], "BOX": [0.06, 0.08, 0.004, 0.002],
    "BOX1": [0.06, 0.08, 0.004, 0.002, 0.003, 0.005], "I": [0.08, 0.06, 0.04, 0.004, 0.006, 0.005],
    "I1": [0.04, 0.004, 0.07, 0.08], "CHAN": [0.04, 0.08, 0.004, 0.006], "CHAN1": [0.04, 0.004, 0.07, 0.08],
    "CHAN2": [0.004, 0.006, 0.05, 0.08], "T": [0.06, 0.08, 0.004, 0.006], "T2": [0.06, 0.08, 0.004, 0.006],
    "T1": [0.06, 0.04, 0.004, 0.006], "CROSS": [0.04, 0.006, 0.08, 0.004], "H": [0.04, 0.012, 0.08, 0.004],
    "Z": [0.03, 0.004, 0.07, 0.08], "L": [0.06, 0.08, 0.004, 0.006], "HAT": [0.04, 0.004, 0.05, 0.02],
    "HEXA": [0.02, 0.08, 0.06],
}  # fmt: skip


@pytest.mark.parametrize("kind", sorted(NASTRAN))
def test_a_section_by_its_dimensions(kind) -> None:
    beam = NASTRAN[kind](*DIMENSIONS[kind])
    area, yy, zz, yz = by_points(kind, DIMENSIONS[kind])
    assert beam.area == pytest.approx(area, rel=2e-3)  # of the raster
    assert beam.inertia[:2] == pytest.approx((zz, yy), rel=2e-3)
    assert beam.inertia[2] == pytest.approx(yz, abs=2e-3 * np.sqrt(yy * zz))


def test_torsion_by_bredt_and_st_venant() -> None:
    square = NASTRAN["BAR"](0.02, 0.02)
    assert square.torsion == pytest.approx(0.1406 * 0.02**4, rel=3e-3)
    box = NASTRAN["BOX"](0.061, 0.081, 0.001, 0.001)
    assert box.torsion == pytest.approx(
        4 * (0.06 * 0.08) ** 2 * 0.001 / (2 * 0.14) + 0.28 * 0.001**3 / 3, rel=1e-9
    )
    # A box with one wall of next to nothing is a channel.
    open_box = NASTRAN["BOX1"](0.06, 0.08, 0.002, 1e-12, 0.002, 0.002)
    assert open_box.torsion == pytest.approx(0.002**3 / 3 * (0.058 + 2 * 0.079), rel=1e-4)
    assert NASTRAN["L"](0.05, 0.05, 0.002, 0.002).torsion == pytest.approx(
        0.002**3 / 3 * 0.098, rel=1e-9
    )


def test_shear_centres() -> None:
    """Of a channel outside its web by 3b²t/(6bt + ht'), of an angle and a T where the walls
    meet.
    """
    channel = NASTRAN["CHAN"](0.041, 0.082, 0.002, 0.002)
    e = 3 * 0.04**2 / (6 * 0.04 + 0.08)
    thin = 0.04**2 / (2 * 0.04 + 0.08)  # the centroid from the web
    assert channel.centroid == pytest.approx((0.0, e + thin), abs=2e-4)
    assert (
        NASTRAN["T"](0.06, 0.08, 0.004, 0.004).centroid[0]
        < 0
        < NASTRAN["T2"](0.06, 0.08, 0.004, 0.004).centroid[0]
    )
    assert NASTRAN["I"](0.08, 0.05, 0.05, 0.004, 0.006, 0.006).centroid == pytest.approx(
        (0, 0), abs=1e-12
    )
