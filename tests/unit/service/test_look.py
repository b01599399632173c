"""What a file that is dropped on a page offers for its form: grid points by the name of their
array, and the size that they reach over.
"""

from pathlib import Path

import numpy as np
import pytest

from service.tasks.look.compute import look_at
from tests.support.uff import dataset

PLACES = np.array([[0, -20, 0], [250, 20, 0], [500, -20, 0], [250, -20, 0], [500, 20, 0]], float)
FRFS = {"H": np.ones((5, 64), complex), "f": np.arange(64.0)}


@pytest.mark.parametrize(
    ("arrays", "labels", "millimetres", "reach"),
    [
        ({"xyz_mm": PLACES}, (1, 2, 3, 4, 5), {"mm": 1.0}, (500, 40)),
        ({"coords": PLACES.T / 25.4, "coords_unit": "in"}, (1, 2, 3, 4, 5), {"in": 25.4}, (19.69, 1.575)),
        ({"nodes": np.column_stack([[7, 4, 9, 2, 1], PLACES / 1e3])}, (7, 4, 9, 2, 1), {"m": 1e3}, (0.5, 0.04)),
        ({"where": PLACES, "point_id": [4, 5, 6, 7, 8]}, (4, 5, 6, 7, 8), {"mm": 1}, (500, 40)),
        ({"x_cm": PLACES[:, 0] / 10, "y_cm": PLACES[:, 1] / 10}, (1, 2, 3, 4, 5), {"cm": 10}, (50, 4)),
    ],
    ids=["unit in the name", "columns, unit beside", "labelled rows", "as many as FRFs", "side by side"],
)  # fmt: skip
def test_coordinates_beside_frfs_are_offered_by_name(
    tmp_path: Path,
    arrays: dict[str, object],
    labels: tuple[int, ...],
    millimetres: dict[str, float],
    reach: tuple[float, float],
) -> None:
    np.savez(tmp_path / "a.npz", **FRFS, **arrays)  # type: ignore[arg-type]
    (offer,) = look_at(tmp_path / "a.npz", "a.npz", None).points
    assert (offer.array.partition(",")[0], offer.labels) == (next(iter(arrays)), labels)
    assert offer.millimetres == pytest.approx(millimetres)
    assert offer.reach == pytest.approx(reach, rel=1e-3)


def test_samples_are_no_places_and_points_that_are_read_say_how_far_they_reach(
    tmp_path: Path,
) -> None:
    """Three channels side by side are as many columns as coordinates; a UFF's points come with it."""
    random = np.random.default_rng(3)
    np.savez(tmp_path / "a.npz", acceleration=random.normal(size=(512, 3)), t=np.arange(512) / 1e3)
    assert look_at(tmp_path / "a.npz", "a.npz", None).points == ()
    lines = [
        f"{label:10d}{0:10d}{0:10d}{0:10d}" + "".join(f"{value:13.5e}" for value in place / 1e3)
        for label, place in enumerate(PLACES, start=1)
    ]
    (tmp_path / "a.uff").write_bytes(dataset("15", *lines))
    assert look_at(tmp_path / "a.uff", "a.uff", None).reach_m == pytest.approx((0.5, 0.04))
