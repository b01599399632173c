"""Spectra, axes and frames by themselves: what is stored comes back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.campaigns.frame import make_frame
from service.campaigns.spectra import DamagedSpectrumError, Spectrum, decode, encode, encode_axis


def test_a_frame_turns_points_and_directions_alike() -> None:
    rng = np.random.default_rng(1)
    q, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    q[:, 2] = np.cross(q[:, 0], q[:, 1])
    frame = make_frame(tuple(rng.standard_normal(3)), tuple(q[:, 0]), tuple(q[:, 1]))
    specimen = rng.standard_normal((5, 3))
    np.testing.assert_allclose(frame.points(specimen @ q.T + frame.origin_m), specimen, atol=1e-14)


def test_csv_comes_back_in(api: httpx.Client, campaign: str, checked: Checked) -> None:
    sent = {**arrays(), "coherence": np.full((4, 50), 0.75)}
    stored = checked(post(api, campaign, **sent), 201)["items"]
    text = api.get(f"campaigns/{campaign}/frfs/data", params={"format": "csv"}).content
    csv_type = {"Content-Type": "text/csv"}
    path = f"campaigns/{campaign}/frfs"
    again = checked(api.post(path, content=text, headers=csv_type, params={"quantity": "mobility"}), 201)["items"]
    assert [f["sha256"] for f in again] == [f["sha256"] for f in stored]
    assert all(f["has_coherence"] for f in again)
    for content, told in (
        (text, "quantity"),
        (b"\n", "line 1"),
        (text.splitlines()[0], "line 2"),
        (text.replace(b"0.5,", b"1/2,", 1), "line 2, frequency_hz"),
        (b"\n".join(text.splitlines()[:52]), "frequency_hz"),
        (text.replace(b"1,3,33,-3,0.5", b"1,3,33,-3", 1), "line 2"),
        (b"\xff" + text, "UTF-8"),
    ):
        params = {} if content is text else {"quantity": "mobility"}
        problem = checked(api.post(path, content=content, headers=csv_type, params=params), 422)
        assert told in str(problem["errors"])
    assert len(checked(api.get(path), 200)["items"]) == 8


@pytest.mark.parametrize("dtype", ["complex64", "complex128"])
def test_uff_goes_out_and_comes_back_in_bit_for_bit(
    api: httpx.Client,
    campaign: str,
    new_campaign: Callable[..., str],
    imported: Callable[..., dict[str, Any]],
    checked: Checked,
    tmp_path: Path,
    dtype: str,
) -> None:
    points = [{"label": n, "x_m": 0.1 * n, "y_m": -0.02, "z_m": 1 / 3} for n in (1, 2, 3, 4, 33)]
    checked(api.put(f"campaigns/{campaign}/grid-points", json={"items": points}), 200)
    sent = arrays(dtype)
    sent["coherence"] = np.linspace(0.1, 0.9, 200).reshape(4, 50)
    checked(post(api, campaign, **sent), 201)
    checked(
        post(api, campaign, **{**arrays(dtype, lines=7), "frequency_hz": np.array([1, 1.5, 3, 3.25, 4, 8, 9])}), 201
    )
    answer = api.get(f"campaigns/{campaign}/frfs/data", headers={"Accept": "application/x-uff"})
    assert answer.headers["content-type"] == "application/x-uff"
    other = new_campaign(name="copy")
    done = imported(other, answer.content)
    assert (done["status"], done["counts"]) == ("succeeded", {"frfs": 8, "grid_points": 5, "modes": 0}), done
    assert checked(api.get(f"campaigns/{other}/grid-points"), 200) == {"items": points}
    was, now = (checked(api.get(f"campaigns/{c}/frfs"), 200)["items"] for c in (campaign, other))
    same = ("response_point", "response_direction", "reference_point", "reference_direction", "quantity", "sha256")
    assert [[f[key] for key in (*same, "dtype", "lines", "has_coherence")] for f in was] == [
        [f[key] for key in (*same, "dtype", "lines", "has_coherence")] for f in now
    ]
    for a, b in zip(was, now, strict=True):
        old, new = (checked(api.get(f"frfs/{f['id']}/data"), 200) for f in (a, b))
        assert old["frequency_hz"] == new["frequency_hz"]
        assert old["frfs"][0]["coherence"] == new["frfs"][0]["coherence"]
    (tmp_path / "out.uff").write_bytes(answer.content)
    sets = pyuff.UFF(str(tmp_path / "out.uff"))
    frfs = [s for s in sets.read_sets() if s["type"] == 58 and s["func_type"] == 4]
    assert len(frfs) == 8
    for mine, theirs in zip(sent["values"], frfs[:4], strict=True):
        np.testing.assert_array_equal(theirs["data"], mine)


def test_uff_as_text_keeps_thirteen_digits(
    api: httpx.Client,
    campaign: str,
    new_campaign: Callable[..., str],
    imported: Callable[..., dict[str, Any]],
    checked: Checked,
) -> None:
    sent = arrays()
    checked(post(api, campaign, **sent), 201)
    text = api.get(f"campaigns/{campaign}/frfs/data", params={"format": "uff-ascii", "fmin": 2, "stride": 2}).content
    assert text.isascii()
    other = new_campaign(name="copy")
    assert imported(other, text)["counts"]["frfs"] == 4
    data = checked(api.get(f"campaigns/{other}/frfs/data"), 200)
    np.testing.assert_allclose(data["frequency_hz"], sent["frequency_hz"][3::2], rtol=1e-12)
    got = np.array([np.array(f["real"]) + 1j * np.array(f["imag"]) for f in data["frfs"]])
    np.testing.assert_allclose(got, sent["values"][:, 3::2], rtol=1e-12)


def test_head_tells_without_sending(api: httpx.Client, campaign: str, checked: Checked) -> None:
    frf = checked(post(api, campaign, **arrays()), 201)["items"][0]["id"]
    for path in (f"frfs/{frf}/data", f"campaigns/{campaign}/frfs/data"):
        head, whole = api.head(path), api.get(path)
        assert (head.status_code, head.content) == (200, b"")
        assert head.headers["Content-Length"] == str(len(whole.content))
        assert head.headers["ETag"] == whole.headers["ETag"]


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.lists(st.complex_numbers(allow_nan=True, allow_infinity=True), min_size=1, max_size=40))
def test_every_spectrum_survives_bit_for_bit(values: list[complex]) -> None:
    for dtype in ("c16", ">c16", "c8"):
        with np.errstate(over="ignore"):
            array = np.array(values).astype(dtype)
        stored = encode(array)
        assert decode(stored).tobytes() == array.astype(array.dtype.newbyteorder("<")).tobytes()
        broken = Spectrum(stored.dtype, stored.count, stored.data[:-1] + bytes([stored.data[-1] ^ 1]), stored.sha256)
        with pytest.raises(DamagedSpectrumError):
            decode(broken)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.floats(0, 1e5), st.floats(1e-3, 100), st.integers(1, 500))
def test_an_axis_keeps_its_lines(start: float, step: float, count: int) -> None:
    even = start + step * np.arange(count)
    stored = encode_axis(even)
    assert (stored.lines is None) == (count > 1)
    np.testing.assert_allclose(stored.frequency_hz(), even, rtol=0, atol=1e-12 * even[-1])
    if count > 2:
        uneven = even.copy()
        uneven[1] += 0.25 * step
        np.testing.assert_array_equal(encode_axis(uneven).frequency_hz(), uneven)
