"""Modes of FRFs as laboratories send them: close, repeated, lightly and heavily damped."""

import numpy as np
import pytest

from tests.support.reality import identified, kept, reality


@pytest.mark.parametrize(
    ("name", "hz", "zeta"),
    [
        ("modes_close_03pct", [60.0, 60.2, 110.0, 150.0], [0.010, 0.012, None, None]),
        ("modes_close_1pct_one_ref", [60.0, 60.6, 110.0, 150.0], [0.010, 0.012, None, None]),
        ("modes_damped_15pct", [40.0, 75.0, 120.0, 160.0], [0.15, 0.12, 0.08, 0.10]),
        ("modes_repeated", [60.0, 60.0, 110.0, 150.0], [None] * 4),
    ],
)
def test_modes_are_found(name: str, hz: list[float], zeta: list[float | None]) -> None:
    modes = identified(kept(reality(f"{name}.unv"))).modes
    np.testing.assert_allclose(modes.frequency_hz, hz, rtol=2e-4)
    for ratio, expected in zip(modes.damping_ratio, zeta, strict=True):
        assert expected is None or ratio == pytest.approx(expected, rel=0.01)


def test_damping_below_what_the_lines_show_is_warned_of() -> None:
    found = identified(kept(reality("modes_light_002pct.unv")))
    np.testing.assert_allclose(found.modes.frequency_hz, [40, 75, 120, 160], rtol=2e-4)
    warned = [warning for warning in found.warnings if "half-power bandwidth covers" in warning]
    assert len(warned) >= 2
