"""The paper's cantilever as fixtures: its body, its model, its measured modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.specimen import Specimen
from fecore.frf import along_z
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import parametrise
from tests.support.cantilever import COUPONS, PARAMETERS, TABLE_4, grid


@pytest.fixture(scope="session")
def nominal() -> Specimen:
    return Specimen(length=0.5, width=0.04, thickness=0.010, material=COUPONS)


@pytest.fixture(scope="session")
def forward(nominal: Specimen) -> ForwardModel:
    points = grid()
    places = np.array(list(points.values()))[:, :2]
    return ForwardModel(nominal, parametrise(nominal, PARAMETERS), along_z(points), places, 12)


@pytest.fixture(scope="session")
def updated_by_paper(nominal: Specimen) -> Specimen:
    return replace(nominal, material=replace(nominal.material, **TABLE_4))
