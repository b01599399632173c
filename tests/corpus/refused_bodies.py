"""Bodies, laws, parameters and recipes that the core refuses: each a call, and how the `InputError`
begins that ends it.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from fecore.body.beam_specimen import BeamSpecimen
from fecore.body.beams import BeamSection
from fecore.body.constants import Parameter
from fecore.body.generators import Piece, panel
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.mesh import CellBlock
from fecore.body.model import Model
from fecore.body.sections import ShellSection, section
from fecore.body.specimen import LayeredSpecimen, OrientedSpecimen, Specimen
from fecore.body.structure import Structure
from fecore.body.supports import PointMass, Spring, edges, of_boundary
from fecore.correlation import csf, frac, frequency_error, mac, pair_modes, sac
from fecore.dynamics.damping_laws import (
    RAYLEIGH,
    CaugheySeries,
    GeneralisedProportional,
    ModalDamping,
    fit_ratios,
)
from fecore.dynamics.dense import largest_eigenpairs
from fecore.dynamics.eigen import normal_modes
from fecore.modes import MeasuredModes
from fecore.updating.campaigns import Campaign, CampaignsRecipe, update_campaigns
from fecore.updating.discretisation import discretise
from fecore.updating.forecasts import ForecastOrder, forecast
from fecore.updating.laws import laws_of
from fecore.updating.layout import Coupon
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update
from fecore.updating.plans import PlannedTest, plan_tests
from fecore.updating.recipe import HoldOut, Recipe
from tests.corpus.updates import BEAM, identified, measured
from tests.support.plates import PAPER, matrices, paper_section, plate
from tests.support.shells import grid
from tests.support.strips import NOMINAL, STRIP

SIZE, MESH = (0.5, 0.04, 0.01), ((0.5, 0.04), (4, 2))
UP = np.array([[0.0, 0.0, 1.0]])
BODY, BAR = Specimen(*SIZE, PAPER), BeamSpecimen(*SIZE, modulus=30e9, poisson=0.3, density=2012.0)
STACK = LayeredSpecimen(0.3, 0.2, 0.004, (Ply(PAPER, 0.002), Ply(PAPER, 0.002, 90)), 1600.0)
ONE, TWO = np.ones((1, 3)), np.ones((2, 3))
FREE = OrientedSpecimen(*STRIP, NOMINAL, "free", divisions=(16, 3))
CAMPAIGN = Campaign("a", "s", FREE, MeasuredModes(np.array([400.0, 1100.0]), np.full(2, np.nan)))
QUADS, FOURS = (
    grid(kind, 2, 2, lambda st: np.column_stack([st, 0 * st[:, 0]])) for kind in ("quad8", "quad4")
)
K, M = matrices(plate((0.5, 0.04), (2, 1), of_boundary("cantilever")), paper_section())
WALL = ShellSection((Ply(PAPER, 0.01),))
TEST = PlannedTest("s", FREE, 4300.0, ((0.1, 0.0), (0.2, 0.01)), 1, specimen="s")


def material(**wrong: Any) -> OrthotropicMaterial:
    right = {"Ex": 1e9, "Ey": 1e9, "Gxy": 1e9, "Gxz": 1e9, "Gyz": 1e9, "nu_xy": 0.3, "density": 1.0}
    return OrthotropicMaterial(**{**right, **wrong})


def shell(
    wall: ShellSection = WALL, elements: np.ndarray | None = None, name: str = "plate", **wrong: Any
) -> Model:
    """The model of four elements with another wall, elements or set, or whose mesh is changed."""
    block = CellBlock("quad8", QUADS.blocks[0].nodes if elements is None else elements, name)
    return Structure(replace(QUADS, **{"blocks": (block,), **wrong}), {"plate": wall}).model


def foreseen(*, divisions: tuple[int, int] = (8, 2), **order: Any) -> object:
    """Of modes, or of places at point 7."""
    asked = {"labels": [7], **order} if "places" in order else order
    return forecast(replace(BODY, divisions=divisions), ForecastOrder(**asked))


def unplaced() -> object:
    points = {label: place for label, place in measured().points.items() if label != 12}
    return update(replace(measured(), points=points), BEAM)


def recipe(**wrong: Any) -> object:
    return update(identified(), BEAM, Recipe(**wrong))


def laws(name: str) -> object:
    return laws_of(Recipe(damping_models=("rayleigh", name)), ModalDamping((100.0,)), BODY)


def parameters(*given: Parameter) -> object:
    return parametrise(BODY, given)


# fmt: off
BODIES: list[tuple[Callable[[], object], str]] = [
    (lambda: material(Ex=0.0), "material.Ex: is 0, expected a positive number"),
    (lambda: material(density=np.nan), "material.density: is nan, expected a finite number"),
    (lambda: material(nu_xy=1.2), "material.nu_xy: nu_xy² Ey/Ex is 1.44, expected below 1: the material would"),
    (lambda: Ply(PAPER, 0.0), "ply.thickness: is 0.0, expected a positive number of metres"),
    (lambda: section([]), "section.plies: is empty, expected at least one ply"),
    (lambda: LayeredSpecimen(0.3, 0.2, 0.004, (), 1600.0), "laminate.plies: is empty, expected at least one ply"),
    (lambda: replace(STACK, density=0.0), "density: is 0.0, expected a positive number of kg/m³"),
    (lambda: parametrise(STACK, [Parameter("Ex")]), "parameters.0.name: is 'Ex', expected one of E1, E2, G12, G13, G23,"),
    (lambda: BeamSection(1e9, 1e9, 1.0, 0.0, (1.0, 1.0, 0.0), 1.0), "section.area: is 0.0, expected a positive number"),
    (lambda: BAR.model.observe(np.array([[1.2, 0.0, 0.0]]), UP), "points[0]: (1.2, 0, 0) m lies 700 mm off the specimen,"),
    (lambda: replace(BAR, poisson=0.5), "beam: has E = 3e+10, nu = 0.5, density = 2012, width = 0.04, thickness ="),
    (lambda: parametrise(BAR, [Parameter("Ex")]), "parameters.0.name: is 'Ex', expected one of E, nu, density, width,"),
    (lambda: parametrise(BAR, [Parameter("E"), Parameter("nu", prior_mean=0.7)]),
     "parameters: the prior means are not those of a positive definite material; look at"),
    (lambda: Specimen(0.5, 0.04, 0.0, PAPER), "geometry.thickness_m: is 0.0, expected a positive number of metres"),
    (lambda: Specimen(0.5, -1.0, 0.01, PAPER).model, "geometry.width_m: is -1.0, expected a positive number of metres"),
    (lambda: plate((1, 1), (0, 2)), "mesh.nx: is 0, expected at least one element"),
    (lambda: plate(*MESH).model.observe(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])),
     "directions[0]: is [1. 0. 0.]; this model has w, rx, ry alone"),
    (lambda: of_boundary("hanging"), "boundary: is 'hanging', expected one of cantilever, free, simply_supported"),
    (lambda: edges(end="glued"), "supports.end: is 'glued', expected free, clamped, simply_supported,"),
    (lambda: PointMass(np.nan, 0.0, 0.004), "point_mass: a mass of 0.004 kg has no place; expected finite x and y in m"),
    (lambda: PointMass(0.1, 0.0, -0.004), "point_mass.mass: is -0.004, expected a mass in kg that is not negative"),
    (lambda: plate(*MESH, (), [PointMass(0.7, 0.0, 0.004)]).model, "added_masses: (0.7, 0, 0) m lies 200 mm off the specimen,"),
    (lambda: Spring("k", 0.0, 3, edge="end"), "spring.stiffness: of k is 0.0, expected positive; leave out a spring of"),
    (lambda: Spring("k", 1.0, 3), "spring: k needs a place: either an edge or a point"),
    (lambda: plate(*MESH, of_boundary("cantilever"), springs=[Spring("k", 1.0, 3, edge="start")]).model,
     "spring: k acts on nothing that moves in this model"),
    (lambda: plate(*MESH, springs=[Spring("k", 1.0, 1, edge="start")]).model,
     "spring: k acts on nothing that moves in this model"),
    (lambda: plate(*MESH, springs=[Spring("k", 1.0, 3, edge="start"), Spring("k", 1.0, 3, edge="end")]).model,
     "springs: two have one name"),
    (lambda: plate(*MESH, springs=[Spring("k", 1.0, 3, edge="top")]).model,
     "nodes: there is no set 'top'; there are start, end, lower, upper"),
    (lambda: replace(BODY, pieces=(Piece(0.0, 0.2, 0.01, 0.01), Piece(0.1, 0.3, 0.01, 0.01))).model,
     "pieces: overlap, or are not in the order of x: 0.2 m is beyond 0.1 m"),
    (lambda: replace(BODY, pieces=(Piece(0.0, 0.6, 0.01, 0.01),)).model, "pieces: end at 0.6 m, beyond the length of 0.5 m"),
    (lambda: Piece(0.0, 0.1, 0.0, 0.01), "piece.thickness: is 0.0, expected a positive number of metres"),
    (lambda: replace(BODY, zones=(0.3, 0.2)), "zones_m: are at [0.3, 0.2], expected rising places between 0 and 0.5 m"),
    (lambda: OrientedSpecimen(*STRIP, NOMINAL, "free", clamp_compliance=0.01), "clamp_compliance: belongs to a clamp; the"),
    (lambda: OrientedSpecimen(*STRIP, NOMINAL, clamp_compliance=-1.0), "clamp_compliance: is -1.0, expected EI/kL, not"),
    (lambda: discretise(replace(BODY, length=500.0, width=40.0, thickness=10.0), 1500.0),
     "geometry: of 500 × 40 × 10 m takes "),
    (lambda: normal_modes(K, M, 0), "count: is 0, expected at least 1 and at most 30: the model has 30 dofs, 0 rigid-body"),
    (lambda: normal_modes(K, M, 31), "count: is 31, expected at least 1 and at most 30: the model has 30 dofs, 0 rigid-body"),
    (lambda: normal_modes(K, -M, 3), "the mass matrix is not positive definite: is the density right? At dof 9 it has -0.0715"),
    (lambda: normal_modes(K - 1e6 * M, M, 3), "the stiffness is not positive definite: are the supports and the constants"),
    (lambda: largest_eigenpairs(np.eye(3), np.diag([1.0, -1.0, 1.0]), 1), "the reduced stiffness is not positive definite:"),
    (lambda: shell(blocks=()), "mesh.blocks: is empty, expected elements"),
    (lambda: shell(elements=QUADS.blocks[0].nodes[:, [0] * 8]), "mesh: element 1 of a block has no area"),
    (lambda: shell(name="other"), "sections: has none for the set other; there are plate"),
    (lambda: shell(nodes=QUADS.nodes[:, :2]), "mesh.nodes: have the shape (21, 2), expected finite (n, 3)"),
    (lambda: shell(nodes=QUADS.nodes[:-1]), "mesh.nodes: of set plate name node 20, which is not there"),
    (lambda: Structure(FOURS, {"plate": replace(WALL, axis=(0.0, 0.0, 1.0))}).model,
     "section.axis: is along the normal of an element; give an axis 1"),
    (lambda: panel(0.4, 0.3, 0.05, 0.004, 0.006, (0.0, 0.0)), "shape.ribs: lie at [0.0, 0.0] m, expected rising places"),
    (lambda: foreseen(highest_hz=10.0), "highest_hz: is 10 Hz and holds 0 modes; the first is at 25."),
    (lambda: foreseen(divisions=(40, 4), highest_hz=1e6), "highest_hz: is 1e+06 Hz and holds 1680 modes; the first is at"),
    (lambda: foreseen(modes=3, damping_ratio=0.01, spacing_hz=1e-4), "line_spacing_hz: of 0.0001 makes more than 20000 lines"),
    (lambda: foreseen(modes=3, damping_ratio=0.01, spacing_hz=1e6), "line_spacing_hz: of 1e+06 leaves no line up to 40"),
    (lambda: foreseen(places=np.array([[2.0, 0, 0]])), "grid_points: point 7 at (2, 0, 0) m lies 1.5e+03 mm off the"),
    (lambda: foreseen(places=np.array([[0.2, 0, 3]])), "grid_points: point 7 at (0.2, 0, 3) m lies 3e+03 mm off the"),
    (lambda: foreseen(places=np.array([[0.2, 0, 0]]), axes=np.array([1])),
     "points: 7 has direction 1, along which this model does not move"),
    (lambda: mac([[1, np.nan]], [[1, 2]]), "a: holds NaN or infinite values"),
    (lambda: mac(ONE, np.ones((1, 2))), "shapes: have 3 and 2 dofs, expected the same dofs"),
    (lambda: frac(ONE, TWO), "frfs: have shapes (1, 3) and (2, 3), expected the same"),
    (lambda: sac(ONE, TWO), "frfs: have shapes (1, 3) and (2, 3), expected the same"),
    (lambda: csf(ONE, TWO), "frfs: have shapes (1, 3) and (2, 3), expected the same"),
    (lambda: frequency_error([0.0], [1.0]), "measured_hz: must be positive"),
    (lambda: frequency_error([1.0], [1.0, 2.0]), "predicted_hz: has shape (2,), expected (1,)"),
    (lambda: pair_modes(None, None, [], [1.0]), "measured_hz: and model_hz have shapes (0,) and (1,), expected two lists"),
    (lambda: pair_modes(None, None, [0.0], [1.0]), "measured_hz: must be positive and finite, model_hz finite"),
    (lambda: pair_modes(None, None, [np.nan], [1.0]), "measured_hz: must be positive and finite, model_hz finite"),
    (lambda: pair_modes(None, None, [1.0], [np.inf]), "measured_hz: must be positive and finite, model_hz finite"),
    (lambda: pair_modes(None, None, [[1.0]], [1.0]), "measured_hz: and model_hz have shapes (1, 1) and (1,), expected two"),
    (lambda: pair_modes(ONE, TWO, [1, 2], [1]), "measured_shapes: and model_shapes give (1, 2) pairs, frequencies (2, 1)"),
    (lambda: pair_modes(TWO, TWO, [1.0], [1.0, 2.0]), "measured_shapes: and model_shapes give (2, 2) pairs, frequencies (1,"),
    (lambda: CaugheySeries("none", ()), "damping.exponents: are (), expected one or more different integers"),
    (lambda: GeneralisedProportional(("cubic",), 100.0), "damping.functions: are ('cubic',), expected one or more different"),
    (lambda: GeneralisedProportional(("root",), 0.0), "damping.reference: is 0.0, expected a positive circular frequency"),
    (lambda: fit_ratios(RAYLEIGH, np.array([160.0]), np.array([0.1])), "damping_ratio: 1 modes cannot fix the rayleigh law's"),
    (lambda: fit_ratios(RAYLEIGH, np.array([160.0, 1000.0]), np.array([0.1, -0.1])), "damping_ratio: must be positive"),
    (lambda: laws("mechanism_support"), "damping_models.1: is 'mechanism_support', but the specimen stands on no"),
    (lambda: laws("structural"), "damping_models.1: is 'structural', expected one of rayleigh, caughey3,"),
    (lambda: parameters(Parameter("E")), "parameters.0.name: is 'E', expected one of Ex, Ey, Gxy, Gxz, Gyz, nu_xy,"),
    (lambda: parameters(Parameter("Ex"), Parameter("Ex")), "parameters.1.name: Ex is named twice"),
    (lambda: parameters(Parameter("Ex", prior_mean=0.0)), "parameters.0.prior_mean: is 0.0, expected a positive number"),
    (lambda: parameters(Parameter("Ex", prior_sd=0.0)), "parameters.0.prior_sd: is 0.0, expected a positive number; to fix"),
    (lambda: parameters(Parameter("Ex", prior_sd=1e9, fixed=True)), "parameters.0.prior_sd: Ex is fixed, so it cannot"),
    (lambda: parameters(Parameter("Ex", tied_to="Ex")), "parameters.0.tied_to: Ex is tied to itself"),
    (lambda: parameters(Parameter("Ex", tied_to="Ey")), "parameters.0.tied_to: 'Ey' is not a free parameter of this recipe"),
    (lambda: parameters(Parameter("Ex", fixed=True)), "parameters: leaves nothing to update; expected at least one that is"),
    (lambda: parameters(Parameter("Ex", fixed=True), Parameter("Ey", tied_to="Ex")),
     "parameters.1.tied_to: 'Ex' is not a free parameter of this recipe"),
    (lambda: parameters(Parameter("nu_xy", prior_mean=1.2), Parameter("Ex")), "parameters: the prior means are not those of"),
    (lambda: recipe(damping_models=()), "damping_models: is empty, expected at least one"),
    (lambda: recipe(damping_models=("coulomb",)), "damping_models.0: is 'coulomb', expected one of rayleigh, caughey3,"),
    (lambda: recipe(band_hz=(600.0, 500.0)), "band_hz: is (600, 500), expected 0 ≤ low < high"),
    (lambda: recipe(hold_out=HoldOut(points=(99,))), "hold_out.points: [99] have no FRF of their own in this campaign"),
    (lambda: recipe(hold_out=HoldOut(points=tuple(range(1, 34)))), "hold_out.points: holds out every FRF, so nothing is left"),
    (lambda: recipe(hold_out=HoldOut(band_hz=(0.0, 1e4))), "hold_out.band_hz: holds out every line of the fitted band"),
    (lambda: recipe(parameters=(Parameter("Ex", fixed=True),)), "parameters: leaves nothing to update; expected at least one"),
    (lambda: unplaced(), "grid_points: points 12 have FRFs but no coordinates; add them"),
    (lambda: update_campaigns([]), "campaigns: is empty, expected at least one"),
    (lambda: update_campaigns([CAMPAIGN, CAMPAIGN]), "campaigns: two have the same name; the result needs names that differ"),
    (lambda: update_campaigns([CAMPAIGN, replace(CAMPAIGN, name="b", body=replace(CAMPAIGN.body, fibre_angle=0.5))]),
     "campaigns: fibre_angle is 0 in a and 0.5 in b, both of specimen "),
    (lambda: update_campaigns([CAMPAIGN], CampaignsRecipe((Parameter("density"),))),
     "parameters.0.name: is 'density', expected one of the material's: Ex, Ey, Gxy, Gxz, Gyz,"),
    (lambda: update_campaigns([CAMPAIGN], CampaignsRecipe(scatter=-1)), "scatter: is -1, expected a share from 0 to 1"),
    (lambda: update_campaigns([CAMPAIGN], CampaignsRecipe((Parameter("Ex"),)), [Coupon("Ey", 1e9, 1e8)]),
     "coupons.0: Ey is not updated; expected one of Ex"),
    (lambda: plan_tests([replace(TEST, sensor=33)]), "sensor: is point 33, expected one of the 2 points"),
    (lambda: plan_tests([replace(TEST, noise=0.0)]), "noise: is 0.0, expected a positive number"),
    (lambda: plan_tests([replace(TEST, highest_hz=1.0)]), "tests.0.highest_hz: is 1 Hz, below the first mode of the model"),
]
# fmt: on
