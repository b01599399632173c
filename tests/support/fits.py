"""Models with rows at points, their modes at the prior means, and stage 1 of one campaign."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.constants import DEFAULT_PARAMETERS, Body, Parameter
from fecore.frf import along_z
from fecore.modes import MeasuredModes
from fecore.updating.elastic import fit_elastic, settled
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.layout import Layout
from fecore.updating.parameters import parametrise
from tests.support.draws import BEAM

COARSE = replace(BEAM, divisions=(20, 2))
"""On which what is not about the mesh is updated: its bias is far below what the sets are drawn
with.
"""

Points = Mapping[int, tuple[float, ...]]


def forward_model(
    body: Body,
    count: int,
    *parameters: str | Parameter,
    points: Points | None = None,
    reduced: bool = True,
    roving_mass: float = 0.0,
) -> ForwardModel:
    """As many modes of a body as asked for, by its constants of these names or by the default ones;
    rows are along z.
    """
    free = [
        Parameter(each) if isinstance(each, str) else each for each in parameters
    ] or DEFAULT_PARAMETERS
    places: FloatArray = np.array([place[:2] for place in (points or {}).values()]).reshape(-1, 2)
    return ForwardModel(
        body, parametrise(body, free), along_z(points or {}), places, count, reduced, roving_mass
    )


def at_prior(forward: ForwardModel) -> ForwardState:
    return forward.solve(forward.parametrisation.prior_mean)


def update_elastic(
    forward: ForwardModel,
    modes: MeasuredModes,
    progress: Callable[[float], None] = lambda _: None,
    *,
    use_shapes: bool = False,
) -> ElasticResult:
    """`fit` from the prior means of a model, whose first points are those of the modes' shapes."""
    return settled(fit_elastic(Layout.of_one(forward, modes), progress, use_shapes=use_shapes))
