"""Beams in space against closed forms; springs, masses and links; measured points."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from fecore.body.beams import BeamSection
from fecore.body.generators import profile, strip
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.mesh import Box, CellBlock, Mesh
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from fecore.body.supports import Link, Mass, Spring, Support, turning
from fecore.errors import InputError, OffSpecimenError
from tests.support.bodies import pencil
from tests.support.shells import grid, isotropic, static

E, G, DENSITY = 210e9, 80e9, 7850.0
SECTION = BeamSection.rectangle(0.02, 0.03, E, G, DENSITY)


def line(kind: str, count: int, direction: np.ndarray, length: float = 1.0) -> Mesh:
    steps = count * (2 if kind == "beam3" else 1)
    nodes = np.linspace(0, length, steps + 1)[:, None] * direction
    i = np.arange(0, steps, 2 if kind == "beam3" else 1)
    elements = (
        np.column_stack([i, i + 2, i + 1]) if kind == "beam3" else np.column_stack([i, i + 1])
    )
    return Mesh(nodes, (CellBlock(kind, elements, "bar"),), {"root": np.array([0])})


def lowest(structure: Structure, count: int) -> np.ndarray:
    K, M = pencil(structure)
    found = scipy.sparse.linalg.eigsh(
        K,
        count,
        M,
        sigma=-1e3,
        return_eigenvectors=False,
        v0=np.random.default_rng(0).standard_normal(K.shape[0]),
    )
    return np.sqrt(np.abs(np.sort(found)))


@pytest.mark.parametrize(("kind", "count", "tolerance"), [("beam3", 20, 2e-5), ("beam2", 80, 2e-3)])
@pytest.mark.parametrize("direction", [np.array([1.0, 0, 0]), np.array([2.0, 2, 1]) / 3])
def test_cantilever_has_eulers_modes(kind, count, tolerance, direction) -> None:
    # A long one, so that Timoshenko's shear and rotary inertia lower the first mode by less than .1
    # %.
    axis = tuple(np.cross(direction, [0, 0, 1.0]))
    structure = Structure(
        line(kind, count, direction, 3.0),
        {"bar": replace(SECTION, axis=axis)},
        supports=(Support("root"),),
    )
    omega = lowest(structure, 2)
    k = 1.8751040687 / 3.0
    for found, second in zip(omega, sorted(SECTION.inertia[:2]), strict=True):
        euler = k**2 * np.sqrt(E * second / (DENSITY * SECTION.area))
        assert found == pytest.approx(euler, rel=1e-3 + tolerance)
        assert found < euler * (1 + tolerance)


@pytest.mark.parametrize("kind", ["beam2", "beam3"])
def test_static_deflection_is_timoshenkos(kind) -> None:
    mesh = line(kind, 8, np.array([1.0, 0, 0]))
    structure = Structure(mesh, {"bar": SECTION}, supports=(Support("root"),))
    tip = int(np.argmax(mesh.nodes[:, 0]))
    force = np.zeros((len(mesh.nodes), 6))
    force[tip, :] = [1e3, 0, 1e3, 1e2, 0, 0]
    moved = static(structure, force)[tip]
    I_y = SECTION.inertia[0]
    bent = 1e3 / (3 * E * I_y) + 1e3 / (5 / 6 * G * SECTION.area)
    assert moved[0] == pytest.approx(1e3 / (E * SECTION.area), rel=1e-9)
    assert moved[3] == pytest.approx(1e2 / (G * SECTION.torsion), rel=1e-9)
    # A beam of two nodes bends by its chords: 1/(4 n²) is missing.
    assert moved[2] == pytest.approx(bent, rel=1e-9 if kind == "beam3" else 1 / (4 * 8**2))


def test_a_beam_off_its_nodes_is_a_rib() -> None:
    # A plate with a rib below: as a beam with an offset and as shells in a wall.
    length, t, height, b = 0.8, 0.004, 0.03, 0.006
    plate = grid(
        "quad8",
        16,
        6,
        lambda st: np.column_stack([length * st[:, 0], 0.3 * (st[:, 1] - 0.5), 0 * st[:, 0]]),
    )
    centre = np.flatnonzero(np.abs(plate.nodes[:, 1]) < 1e-9)
    centre = centre[np.argsort(plate.nodes[centre, 0])]
    i = np.arange(0, len(centre) - 1, 2)
    beams = CellBlock("beam3", np.column_stack([centre[i], centre[i + 2], centre[i + 1]]), "rib")
    E_s, nu = 70e9, 0.3
    rib = replace(
        BeamSection.rectangle(b, height, E_s, E_s / 2 / (1 + nu), 2700.0),
        offset=(0.0, 0.0, -(height + t) / 2),
    )
    stiffened = Structure(
        Mesh(plate.nodes, (*plate.blocks, beams)),
        {"plate": isotropic(E_s, nu, t, 2700.0), "rib": rib},
    )
    omega = lowest(stiffened, 16)
    assert omega[5] < 1e-2 * omega[6]
    K, _ = pencil(stiffened)
    rigid = stiffened.model.rigid_modes
    assert np.abs(K @ rigid).max() < 1e-10 * abs(K).max()
    # Bending along the rib follows the composite section: (EI) of plate and rib about their common
    # axis.
    areas, z = np.array([0.3 * t, b * height]), np.array([0.0, -(height + t) / 2])
    axis = areas @ z / areas.sum()
    inertia = 0.3 * t**3 / 12 + b * height**3 / 12 + areas @ (z - axis) ** 2
    beam = Structure(
        line("beam3", 20, np.array([1.0, 0, 0]), length),
        {
            "bar": BeamSection(
                E_s, E_s / 2.6, 2700.0, float(areas.sum()), (float(inertia), 1e-3, 0.0), 1e-6
            )
        },
    )
    first = lowest(beam, 7)[6]
    assert np.min(np.abs(omega[6:] / first - 1)) < 0.05  # shear lag and Poisson's ratio


def test_masses_and_springs() -> None:
    # A body on springs is an oscillator: ω² = k/m below all else.
    mesh = grid("quad8", 4, 4, lambda st: np.column_stack([st, 0 * st[:, 0]]))
    corners = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
    springs = tuple(Spring(f"k{i}", 100.0, 3, point=where) for i, where in enumerate(corners))
    held = (Support(Box((0, 0, 0), (1, 1, 0)), ("u", "v", "rz")),)
    mass = Mass(3.0, (0.5, 0.5, 0.0), 0.02)
    structure = Structure(
        mesh, {"plate": isotropic(70e9, 0.3, 0.01, 500.0)}, held, springs, (mass,)
    )
    K, M = pencil(structure)
    values = scipy.linalg.eigh(K.toarray(), M.toarray(), eigvals_only=True, subset_by_index=[0, 2])
    assert values.min() == pytest.approx(400 / (5 + 3), rel=3e-3)  # the plate bends a little
    assert structure.model.stiffness.names[-4:] == ("k0", "k1", "k2", "k3")
    assert structure.model.rigid_modes.shape[1] == 0
    with pytest.raises(InputError, match="acts on nothing"):
        _ = replace(structure, springs=(Spring("k", 1.0, 1, point=(0.0, 0.0, 0.0)),)).model


def test_an_edge_spring_is_the_sum_of_its_length() -> None:
    mesh = strip(0.5, 0.04, 10, 2)
    section = isotropic(70e9, 0.3, 0.004)
    along = Structure(mesh, {"strip": section}, springs=(Spring("k", 1.0, 3, "start"),))
    k = list(along.model.stiffness.names).index("k")
    up = along.model.motions[:, [2]]
    assert float((up.T @ (along.model.stiffness.term(k) @ up))[0, 0]) == pytest.approx(
        0.04, rel=1e-12
    )
    assert along.model.rigid_modes.shape[1] == 4  # heave and roll are held


def test_rigid_link_and_mean_move_as_a_body() -> None:
    mesh = grid("quad8", 2, 2, lambda st: np.column_stack([st, 0 * st[:, 0]]))
    hub = np.array([[0.3, 0.4, 0.5]])
    nodes = np.concatenate([mesh.nodes, hub])
    number = len(nodes) - 1
    section = {"plate": isotropic(70e9, 0.3, 0.01, 1000.0)}
    lone = Mesh(nodes, mesh.blocks)
    for link in (
        Link(number, (0,)),
        Link(number, (0, 1, 2, 3)),
        Link(number, (0, 4, 1)),  # on a line
        Link(number, (0,), dofs=(0, 1, 2)),
    ):
        masses = (Mass(2.0, number, 0.01),)
        structure = Structure(lone, section, masses=masses, links=(link,))
        K, M = pencil(structure)
        motions = structure.model.rigid_modes
        assert np.abs(K @ motions).max() < 1e-9 * abs(K).max()
        shift = motions.T @ (M @ motions)
        assert shift[0, 0] == pytest.approx(0.01 * 1000 + 2.0, rel=1e-9)
        assert motions.shape[1] == 6
        arm = hub[0] - lone.nodes.mean(axis=0)
        own = turning(arm)[:, 2] @ turning(arm)[:, 2]
        assert shift[5, 5] > own * 2.0
    bad = Structure(
        lone,
        section,
        masses=(Mass(2.0, number),),
        links=(Link(number, (0, 0)),),
    )
    with pytest.raises(InputError, match="lie in one place"):
        _ = bad.model


def test_points_see_the_walls_rotation() -> None:
    material = OrthotropicMaterial(25e9, 9e9, 3e9, 3e9, 2.4e9, 0.27, 1850.0)
    mesh = profile("i", 0.3, 0.06, 0.04, 0.005, 0.004, elements=3)
    sections = {
        name: ShellSection((Ply(material, t),)) for name, t in (("flange", 0.005), ("web", 0.004))
    }
    model = Structure(mesh, sections).model
    random = np.random.default_rng(4)
    top = np.column_stack(
        [random.uniform(0, 0.3, 20), random.uniform(-0.02, 0.02, 20), np.full(20, 0.03)]
    )
    side = np.column_stack(
        [random.uniform(0, 0.3, 20), np.full(20, 0.002), random.uniform(-0.02, 0.02, 20)]
    )
    points = np.concatenate([top, side])
    directions = random.standard_normal((40, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    seen = model.observe(points, directions)
    arms = turning(points - mesh.nodes.mean(axis=0))
    moved = np.concatenate([np.broadcast_to(np.eye(3), arms.shape), arms], axis=2)
    # Any rigid motion is seen as that of the point itself, on the face and not amid the wall.
    np.testing.assert_allclose(
        seen @ model.motions, np.einsum("pk,pkm->pm", directions, moved), atol=1e-12
    )
    places = model.surfaces.find(points)
    # within d of a line the surface is its edge
    np.testing.assert_allclose(places.distance[:20], 0.0025, rtol=0.05)
    assert {mesh.blocks[b].set for b in places.block[20:]} == {"web"}
    with pytest.raises(
        OffSpecimenError, match=r"lies 22\.5 mm off the specimen, which spans x 0 … 0.3 m"
    ):
        model.observe(np.array([[0.1, 0.0, 0.05]]), np.array([[0.0, 0, 1]]))
