"""The paper's cantilever as fixtures: its body, its model, its measured modes."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from fecore.body.specimen import Specimen
from fecore.updating import elastic_starts
from fecore.updating.forward import ForwardModel
from fecore.updating.measurement import Measurement, Recipe, prepare
from fecore.updating.pipeline import update
from fecore.updating.result import UpdateResult
from tests.support.cantilever import COUPONS, PARAMETERS, TABLE_4, grid
from tests.support.draws import Drawn, beam
from tests.support.fits import COARSE, forward_model


@pytest.fixture(scope="session")
def nominal() -> Specimen:
    return Specimen(length=0.5, width=0.04, thickness=0.010, material=COUPONS)


@pytest.fixture(scope="session")
def forward(nominal: Specimen) -> ForwardModel:
    return forward_model(nominal, 12, *PARAMETERS, points=grid())


@pytest.fixture(scope="session")
def drawn() -> Drawn:
    """A laboratory's FRFs of a cantilever like it."""
    return beam(0)


@pytest.fixture(scope="session")
def identified(drawn: Drawn) -> Measurement:
    """The same with its modes handed in, where a test is not about identification: the results keep
    their bits.
    """
    return replace(drawn.measurement, modes=prepare(drawn.measurement, COARSE, Recipe()).modes)


@pytest.fixture(scope="session")
def result(drawn: Drawn) -> UpdateResult:
    """What an update makes of these FRFs."""
    return update(drawn.measurement, COARSE)


@pytest.fixture(scope="module")
def _few_draws() -> Iterator[None]:
    """A search by FRFs alone draws a 32nd of its starts, for a module of tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(elastic_starts, "_DRAWN_BY_FRFS", 16)
        yield


@pytest.fixture(scope="session")
def updated_by_paper(nominal: Specimen) -> Specimen:
    return replace(nominal, material=replace(nominal.material, **TABLE_4))
