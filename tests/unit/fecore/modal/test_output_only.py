"""Modes of responses to loads that nobody measured, on another code's recordings and on a made one
with a machine.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy

from fecore.correlation import mac
from fecore.errors import InputError
from fecore.frf import along_z
from fecore.modal.recordings import OutputOnly, identify_output_only, without_window
from fecore.modes import MeasuredModes
from fecore.signal.half_spectra import HalfSpectra, half_spectra
from tests.support.lengths import long


def spectra_of(folder: Path, setup: int, truth: dict[str, Any]) -> HalfSpectra:
    points = truth["setups"][setup]
    with np.load(folder / f"setup_{setup + 1}.npz") as file:
        x = np.stack([file[f"a_{point}"] for point in points])
    return half_spectra(
        lambda: [x], truth["rate_hz"], along_z(points), along_z(truth["references"])
    )


@pytest.mark.parametrize("name", [long("ambient-1"), "ambient-2"])
def test_modes_of_another_code_come_back(blind_open: Path, name: str) -> None:
    """One recording of eight points; four of 26, of which two stay, while all frequencies drift."""
    folder = blind_open / "ambient" / name
    truth = json.loads((folder / "truth.json").read_text())
    setups = [spectra_of(folder, k, truth) for k in range(len(truth["setups"]))]
    found = identify_output_only(setups)
    modes = found.identification.modes
    f = np.array([each["f_hz"] for each in truth["modes"]])
    zeta = np.array([each["zeta"] for each in truth["modes"]])
    assert len(modes) == f.size
    assert found.harmonics_hz == ()
    assert modes.frequency_sd_hz is not None
    assert modes.damping_sd is not None
    assert modes.shapes is not None
    np.testing.assert_allclose(modes.frequency_hz, f, rtol=2e-3)
    # 3 standard deviations: of 12 modes one in thirty sets has one beyond
    assert np.max(np.abs(modes.frequency_hz - f) / modes.frequency_sd_hz) < 3
    assert np.max(np.abs(modes.damping_ratio - zeta) / modes.damping_sd) < 3
    assert np.max(modes.frequency_sd_hz / f) < 4e-3
    rows = [dof.point - 1 for dof in modes.dofs]
    true = np.array([each["shape"] for each in truth["modes"]])[:, rows]
    assert np.diag(mac(modes.shapes, true)).min() > 0.99


@pytest.fixture(scope="module")
def with_machine() -> OutputOnly:
    """Modes at 3, 8 and 13 Hz under white loads, and a machine at 9 Hz; ten minutes at 50 Hz."""
    rng, rate, count = np.random.default_rng(11), 50.0, 30_000
    f, zeta = np.array([3.0, 8.0, 13.0]), np.array([0.012, 0.008, 0.01])
    shapes = np.array([[1.0, 0.8, 0.5], [0.6, -0.7, 1.0], [-0.4, 1.0, 0.7]])
    pole = np.exp(2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2)) / rate)
    modal = [
        scipy.signal.lfilter(
            [1, -each.real], [1, -2 * each.real, abs(each) ** 2], rng.standard_normal(count)
        )
        for each in pole
    ]
    x = shapes.T @ np.array(modal)
    x += 2 * np.sin(2 * np.pi * 9 * np.arange(count) / rate)
    x += 0.02 * x.std() * rng.standard_normal(x.shape)
    return identify_output_only(half_spectra(lambda: [x], rate, along_z((1, 2, 3))))


def test_a_machine_is_named_and_no_mode(with_machine: OutputOnly) -> None:
    modes, notes = with_machine.identification.modes, with_machine.identification.notes
    np.testing.assert_allclose(with_machine.harmonics_hz, [9.0], atol=1e-3)
    np.testing.assert_allclose(modes.frequency_hz, [3.0, 8.0, 13.0], rtol=5e-3)
    (said,) = (each.sentence for each in notes if each.kind == "harmonic")
    assert said.startswith("9.000 Hz is a harmonic")
    words = repr(with_machine.identification.found.features)
    assert "half spectrum" in words
    assert "FRF" not in words


def test_a_short_recording_says_how_long_it_should_be(with_machine: OutputOnly) -> None:
    notes = with_machine.identification.notes
    assert not [each for each in notes if each.kind == "recording_short"]
    assert set(with_machine.identification.used) >= {"1Z/2Z", "3Z/2Z"}


def test_the_window_is_taken_out_as_its_derivatives_say() -> None:
    rng = np.random.default_rng(3)
    f, zeta = np.array([1.5, 20.0]), np.array([0.03, 0.01])
    root = rng.standard_normal((4, 4)) * np.array([1e-3, 1e-2, 1e-3, 1e-3])[:, None]
    modes = MeasuredModes(f, zeta)

    def poles(theta: np.ndarray) -> np.ndarray:
        each = without_window(MeasuredModes(theta[:2], theta[2:]), np.eye(4), 0.2)
        return np.concatenate([each.frequency_hz, each.damping_ratio])

    theta = np.concatenate([f, zeta])
    step = 1e-6 * theta
    turn = np.array(
        [(poles(theta + d) - poles(theta - d)) / (2 * d.sum()) for d in np.diag(step)]
    ).T
    found = without_window(modes, root @ root.T, 0.2).covariance
    np.testing.assert_allclose(found, turn @ root @ root.T @ turn.T, rtol=1e-6)
    # the damped frequency stays, the rate is less by the window's
    w, ratio = 2 * np.pi * poles(theta)[:2], poles(theta)[2:]
    np.testing.assert_allclose(w * np.sqrt(1 - ratio**2), 2 * np.pi * f * np.sqrt(1 - zeta**2))
    np.testing.assert_allclose(w * ratio, 2 * np.pi * f * zeta - 0.2)


def test_setups_need_a_reference_in_common(blind_open: Path) -> None:
    folder = blind_open / "ambient" / "ambient-2"
    truth = json.loads((folder / "truth.json").read_text())
    first = spectra_of(folder, 0, truth)
    truth["references"] = truth["setups"][1][2:4]
    with pytest.raises(InputError, match="setup 2 has no reference in common"):
        identify_output_only([first, spectra_of(folder, 1, truth)])
