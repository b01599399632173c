"""FRFs and coherences of an analyser's .mat, by a mapping."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from modalbase.formats.errors import FormatError
from modalbase.formats.frfs import read_mat
from modalbase.formats.frfs.mat import propose_frfs
from modalbase.formats.records import read_variables

RNG = np.random.default_rng(3)
HZ = np.arange(1.0, 65.0)
H = RNG.standard_normal((3, 64)) + 1j * RNG.standard_normal((3, 64))
GAMMA = RNG.uniform(0.5, 1.0, (3, 64))
MAPPING: dict[str, Any] = {
    "frequency_hz": {"variable": "m.f"},
    "frf": {"variable": "m.H"},
    "coherence": {"variable": "m.coh"},
    "response_point": 33,
    "reference_point": {"variable": "m.points"},
    "factor": 9.80665,
}


def structure(path: Path) -> None:
    savemat(
        path,
        {"m": {"f": HZ, "H": H.T, "coh": GAMMA.T, "points": [4, 5, 7], "endless": np.full(3, np.inf), "name": "tour"}},
    )


def newer(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        compound = np.empty((3, 64), dtype=[("real", "f8"), ("imag", "f8")])
        compound["real"], compound["imag"] = H.real, H.imag
        file["m/f"], file["m/coh"], file["m/points"] = HZ[None], GAMMA, np.array([[4.0, 5.0, 7.0]])
        file["m/H"] = compound
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: TEST")


@pytest.mark.parametrize("write", [structure, newer])
def test_a_structure_of_frfs_and_coherences(tmp_path: Path, write: Any) -> None:
    path = tmp_path / "tour.mat"
    write(path)
    found = read_mat(path, MAPPING, "accelerance")
    np.testing.assert_allclose(found.values, H * 9.80665, rtol=1e-14)
    np.testing.assert_array_equal(found.coherence, GAMMA)
    np.testing.assert_array_equal(found.frequency_hz, HZ)
    dofs = [(r.response_point, r.response_direction, r.reference_point, r.reference_direction) for r in found.frfs]
    assert dofs == [(33, 3, 4, 3), (33, 3, 5, 3), (33, 3, 7, 3)]
    bare = {k: v for k, v in MAPPING.items() if k not in ("coherence", "reference_point", "factor")}
    parts = read_mat(path, {**bare, "reference_point": 4, "frf": {"real": "m.coh", "imaginary": "m.coh"}}, "mobility")
    np.testing.assert_array_equal(parts.values, (1 + 1j) * GAMMA)
    assert (parts.coherence, {row.reference_point for row in parts.frfs}) == (None, {4})
    with pytest.raises(FormatError, match=r"mapping\.reference_point: is missing"):
        read_mat(path, bare, "accelerance")
    proposal = propose_frfs(read_variables(path))
    assert {k: proposal[k] for k in ("frequency_hz", "frf", "coherence")} == {
        k: MAPPING[k] for k in ("frequency_hz", "frf", "coherence")
    }


def test_a_proposal_prefers_the_frf_to_other_spectra() -> None:
    """As one analyser names what it exports; its coherence exceeds 1 at 0 Hz."""
    variables = {
        "Freq_domain": HZ[:, None],
        "Hf_Cross_Spec_chan_2": H[:1].T,
        "Hf_chan_2": H[:1].T,
        "Hf_coh_chan_2": 1.2 * np.ones((HZ.size, 1)),
        "Lin_Spec": np.full((HZ.size, 1), 0.5),
    }
    proposal = propose_frfs(variables)
    assert [proposal[k]["variable"] for k in ("frequency_hz", "frf", "coherence")] == [
        "Freq_domain",
        "Hf_chan_2",
        "Hf_coh_chan_2",
    ]
    assert "coherence" not in propose_frfs({k: variables[k] for k in ("Freq_domain", "Hf_chan_2")})


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"frf": {"variable": "m.coh"}}, "is real: an FRF without phase"),
        ({"frf": {"variable": "m.Q"}}, "is not in the file; it has m.H"),
        ({"frf": {"real": "m.coh", "imaginary": "m.points"}}, "none of it the 64 frequencies"),
        ({"coherence": {"variable": "m.f"}}, "has 1 functions, frf 3"),
        ({"reference_point": [1, 2]}, "no whole number for each of the 3 FRFs"),
        ({"response_direction": 0}, "is no direction"),
        ({"factor": 0}, "expected a number other than 0"),
        ({"reference_point": ["a", 5, 7]}, "no whole number for each of the 3 FRFs"),
        ({"reference_point": [[4], [5, 7]]}, "no whole number for each of the 3 FRFs"),
        ({"reference_point": {"variable": "m.f", "row": 1}}, "no whole number for each of the 3 FRFs"),
        ({"reference_point": {"variable": "m.endless"}}, "no whole number for each of the 3 FRFs"),
        ({"frf": {"real": "m.H", "imaginary": "m.H"}}, "m.H: is complex, expected the real numbers of frf"),
        ({"frf": {"real": "m.coh", "imaginary": "m.f"}}, "mapping.frf: has 3 real and 1 imaginary parts"),
        ({"frf": "m.H"}, r"mapping.frf: is 'm.H', expected \{\"variable\": name\} or"),
        ({"frequency_hz": "m.f"}, r"mapping.frequency_hz: is 'm.f', expected \{\"variable\": name\}"),
        ({"frequency_hz": {"variable": "m.H"}}, "m.H: is complex, expected the real numbers of frequency_hz"),
        ({"sensor": 1}, "is not an object of"),
    ],
)
def test_a_mapping_that_does_not_fit_is_named(tmp_path: Path, change: dict[str, Any], fault: str) -> None:
    path = tmp_path / "tour.mat"
    structure(path)
    with pytest.raises(FormatError, match=fault):
        read_mat(path, {**MAPPING, **change}, "accelerance")
    with pytest.raises(FormatError, match=r"suggests .*'frf': \{'variable': 'm.H'\}"):
        read_mat(path, None, "accelerance")
