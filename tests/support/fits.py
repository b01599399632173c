"""Stage 1 of one campaign, for tests that have a model and modes."""

from collections.abc import Callable

from fecore.modes import MeasuredModes
from fecore.updating.elastic import fit
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.forward import ForwardModel
from fecore.updating.layout import Layout


def update_elastic(
    forward: ForwardModel,
    modes: MeasuredModes,
    progress: Callable[[float], None] = lambda _: None,
    *,
    use_shapes: bool = False,
) -> ElasticResult:
    """`fit` from the prior means of a model, whose first points are those of the modes' shapes."""
    return fit(Layout.of_one(forward, modes), progress, use_shapes=use_shapes)
