"""What jobs compute, without queue and database: spectra, frames, plies, files, hits, memory."""

import json
import os
import tempfile
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from starlette.requests import Request

from fecore.body.constants import Parameter
from fecore.body.laminate import SHEAR_CORRECTION
from fecore.body.specimen import LayeredSpecimen, Specimen
from fecore.errors import InputError
from fecore.frf import Dof
from fecore.signal import Averages, Processing, Windows
from fecore.updating.campaigns import CampaignsRecipe
from fecore.updating.forward import ForwardModel
from fecore.updating.measurement import Recipe
from fecore.updating.parameters import parametrise
from modalbase.formats.uff import DatasetReport, Function, GridPoint
from service.compute.hits import BlockRow
from service.compute.processing import PointFile, ProcessingInputs
from service.compute.spectra import Spectrum, decode, encode, encode_axis
from service.nouns.coupons import routes as bodies
from service.nouns.records.processings import decisions
from service.nouns.records.schemas import OverruleIn
from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.bodies import body_of, nominal_specimen, oriented
from service.nouns.updates.schemas import RecipeIn
from service.platform.errors import Damaged, PayloadTooLarge
from service.platform.queue import process, subprocess_read
from service.platform.queue.child import Failure, Item
from service.platform.queue.process import LOST, ChildEnded
from service.tasks.import_file import compute as reading
from service.tasks.process.compute import process_records
from service.tasks.update.compute import LoadedCampaign, Together, UpdateInputs, compute_update
from tests.corpus.updates import BEAM, measured
from tests.support.uff import axis, dataset, function
from tests.support.waiting import completed


@settings(max_examples=50)
@given(st.lists(st.complex_numbers(allow_nan=True, allow_infinity=True), min_size=1, max_size=40))
def test_every_spectrum_survives_bit_for_bit(values: list[complex]) -> None:
    for dtype in ("c16", ">c16", "c8"):
        with np.errstate(over="ignore"):
            array = np.array(values).astype(dtype)
        stored = encode(array)
        assert decode(stored).tobytes() == array.astype(array.dtype.newbyteorder("<")).tobytes()
        broken = Spectrum(
            stored.dtype,
            stored.count,
            stored.data[:-1] + bytes([stored.data[-1] ^ 1]),
            stored.sha256,
        )
        with pytest.raises(Damaged):
            decode(broken)


@settings(max_examples=50)
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


# --- a structure's plies become the specimen that updating takes
# --------------------------------------------------------

FACE = {
    "E1_Pa": 70e9,
    "E2_Pa": 70e9,
    "G12_Pa": 26e9,
    "G13_Pa": 26e9,
    "G23_Pa": 26e9,
    "nu_12": 0.3,
    "density_kg_m3": 2700.0,
}
CORE = {
    "E1_Pa": 1e6,
    "E2_Pa": 1e6,
    "G12_Pa": 5e5,
    "G13_Pa": 4e7,
    "G23_Pa": 2e7,
    "nu_12": 0.0,
    "density_kg_m3": 100.0,
}
T, H, LENGTH, WIDTH = 0.0005, 0.02, 0.6, 0.04


def structure(plies: list[dict[str, float]]) -> StructureIn:
    thickness = sum(ply["thickness_m"] for ply in plies)
    mass = sum(ply["thickness_m"] * (ply["density_kg_m3"] or 0.0) for ply in plies)
    return StructureIn.model_validate(
        {
            "name": "s",
            "geometry": {"length_m": LENGTH, "width_m": WIDTH, "thickness_m": thickness},
            "density_kg_m3": mass / thickness,
            "laminate": {"plies": plies},
        }
    )


def ply(material: dict[str, float], thickness: float) -> dict[str, float]:
    return {**material, "thickness_m": thickness, "angle_deg": 0.0}


def test_a_sandwich_has_the_shear_stiffness_and_the_frequency_of_the_published_solution() -> None:
    """Allen, Analysis and Design of Structural Sandwich Panels (1969): S = G_c (h + t)²/h, and a
    simply supported strip's ω = (π/L)² √(D/m) / √(1 + π² D/(L² S)) with D = E_f t (h + t)²/2.
    """
    body = nominal_specimen(
        structure([ply(FACE, T), ply(CORE, H), ply(FACE, T)]), "simply_supported"
    )
    shear, bending = 4e7 * (H + T) ** 2 / H, 70e9 * T * (H + T) ** 2 / 2
    assert body.material.Gxz * SHEAR_CORRECTION * body.thickness == pytest.approx(shear, rel=0.01)
    alike = nominal_specimen(structure([ply(FACE, 0.002)] * 4), "free")
    assert alike.material.Gxz == pytest.approx(26e9, rel=1e-9)  # the shear of one layer
    assert alike.layers == ()
    prior = parametrise(body, [Parameter("Ex")])
    forward = ForwardModel(body, prior, (), np.zeros((0, 2)), 4, reduced=False)
    mass = 2 * T * 2700.0 + H * 100.0
    wave = (np.pi / LENGTH) ** 2
    expected = wave * np.sqrt(bending / mass) / np.sqrt(1 + wave * bending / shear) / (2 * np.pi)
    assert forward.solve(prior.prior_mean).frequency_hz[0] == pytest.approx(expected, rel=0.01)


def test_a_sandwich_turns_as_its_faces_do() -> None:
    """I2 = ∫ρz² dz of the stack, whichever body its one layer becomes: evenly spread it would be a
    third of it.
    """
    plain = nominal_specimen(structure([ply(FACE, T), ply(CORE, H), ply(FACE, T)]), "free")
    expected = 2 / 3 * (2700.0 * ((H / 2 + T) ** 3 - (H / 2) ** 3) + 100.0 * (H / 2) ** 3)
    for body in (plain, oriented(plain, plain.material, 0.0)):
        assert body.section.inertia[2] == pytest.approx(expected, rel=1e-9)
        q = np.array(list(body.nominal.values()))
        assert np.any(np.isclose(body.mass_coefficients(q), expected, rtol=1e-9, atol=0))


def test_the_constants_that_a_recipe_names_decide_whether_a_laminate_is_updated_by_plies() -> None:
    one_layer = structure([ply(FACE, T), ply(CORE, H), ply(FACE, T)])
    none = structure([ply(FACE, T), ply(CORE, H + T)])
    (of_plies, of_layer, open_) = (
        RecipeIn.model_validate({"parameters": named})
        for named in ([{"name": "E1"}], [{"name": "Ex"}], None)
    )
    kinds = [
        type(body_of(stated, "free", recipe))
        for stated, recipe in (
            (one_layer, of_plies),
            (one_layer, of_layer),
            (one_layer, open_),
            (none, open_),
        )
    ]
    assert kinds == [LayeredSpecimen, Specimen, Specimen, LayeredSpecimen]
    with pytest.raises(InputError, match="name constants of its plies as parameters: E1, E2"):
        body_of(none, "free", of_layer)


# --- files and forms as the service reads them, in the process itself
# ---------------------------------------------------


def spectrum(
    number: int, values: np.ndarray, response: int, reference: int, ordinate: bytes
) -> bytes:
    return function(
        number, values, ordinate=ordinate, response=(response, 3), reference=(reference, 3)
    )


def test_spectra_of_a_file_become_an_frf_and_points_come_in_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hz = np.arange(256.0)
    exact = 1 / ((300.0 / 6) ** 2 - hz**2 + 2j * hz)
    points = dataset(
        "15", *(f"{n:10d}{0:10d}{0:10d}{0:10d}{n:13.5e}{0:13.5e}{0:13.5e}" for n in (1, 2, 3))
    )
    parts = (
        points,
        spectrum(2, np.full(256, 2.0), 1, 1, axis(13, "NONE")),
        spectrum(2, 16 * np.abs(exact) ** 2, 7, 7, axis(8, "NONE")),
        spectrum(3, 2 * exact, 7, 1, axis(8, "NONE")),
    )
    path = tmp_path / "file.uff"
    path.write_bytes(b"".join(parts))
    monkeypatch.setattr(reading, "POINTS_AT_ONCE", 2)
    items = list(reading.read_upload(reading.ReadingInputs(path, None), lambda *_: None))
    blocks = [item for item in items if isinstance(item, list)]
    assert [[point.number for point in block] for block in blocks] == [[1, 2], [3]]
    assert all(isinstance(point, GridPoint) for block in blocks for point in block)
    (frf,) = [item for item in items if isinstance(item, reading.EncodedFrf)]
    assert (frf.response_point, frf.reference_point, frf.axis.count) == (7, 1, 256)
    (coherence,) = [item for item in items if isinstance(item, Function)]
    np.testing.assert_allclose(coherence.values, 4 / 32, rtol=1e-9)  # |2 H|² over 2 and 16 |H|²
    assert [item.number for item in items if isinstance(item, DatasetReport)] == [1, 2, 3, 4]
    path.write_bytes(parts[0][:-20])
    with pytest.raises(InputError, match=r"\(byte "):
        list(reading.read_upload(reading.ReadingInputs(path, None), lambda *_: None))


class Dead:
    """A child in whose place an error comes."""

    def __init__(self, order: subprocess_read.Order) -> None:
        self.order = order

    def messages(self) -> Iterator[Item]:
        """What the function makes, as if it had come through a channel."""
        try:
            yield from map(Item, self.order.compute(self.order.inputs, None))
        except ZeroDivisionError:
            raise ChildEnded(
                Failure("internal", "ZeroDivisionError", "internal error", trace="the trace")
            ) from None
        except MemoryError:
            raise ChildEnded(
                Failure("memory", "MemoryError", "the job needs more memory")
            ) from None

    def kill(self, why: Failure) -> None:
        """Nothing runs."""

    def close(self) -> None:
        """Nothing is open."""


def raises(error: Exception) -> None:
    raise error


def test_a_body_is_read_although_the_fork_server_died_and_what_it_meets_is_told_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    died, prepared = [LOST], []

    def begun(order: subprocess_read.Order) -> Dead:
        if died:
            raise ChildEnded(died.pop())
        return Dead(order)

    monkeypatch.setattr(subprocess_read, "Child", begun)
    monkeypatch.setattr(
        subprocess_read, "preload", lambda modules, threads: prepared.append((modules, threads))
    )
    assert subprocess_read._read(partial(len, "abc")) == 3
    assert prepared == [(subprocess_read._modules, 1)] * 2
    with pytest.raises(InputError, match="is empty"):
        subprocess_read._read(partial(raises, InputError("file", "is empty")))
    with pytest.raises(RuntimeError, match="the trace"):
        subprocess_read._read(partial(raises, ZeroDivisionError()))
    with pytest.raises(PayloadTooLarge, match="cannot be read here: the job needs more memory"):
        subprocess_read._read(partial(raises, MemoryError()))


def test_sockets_of_the_fork_server_fit_under_a_long_folder(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for usual, within in (("/x" * 60, "/tmp"), ("/short", "/short")):
        monkeypatch.setattr(tempfile, "tempdir", usual)
        with process._short_folder():
            assert tempfile.gettempdir() == within
        assert tempfile.gettempdir() == usual


def multipart_request(**fields: str) -> Request:
    """A request with a file of 40 bytes and text fields."""
    text = "".join(
        f'--x\r\nContent-Disposition: form-data; name="{k}"\r\n\r\n{v}\r\n'
        for k, v in fields.items()
    )
    file = (
        'Content-Disposition: form-data; name="file"; filename="a.csv"\r\nContent-Type:'
        " text/csv\r\n\r\n"
    )
    body = f"{text}--x\r\n{file}{40 * '1'}\r\n--x--\r\n".encode()

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": body, "more_body": False}

    headers = [(b"content-type", b"multipart/form-data; boundary=x")]
    return Request({"type": "http", "method": "POST", "path": "/", "headers": headers}, receive)


def test_a_curve_has_no_more_bytes_than_a_json_body() -> None:
    with pytest.raises(PayloadTooLarge, match="the file has 40 bytes, the operator allows 30"):
        completed(bodies._curve(multipart_request(coupon=json.dumps({})), 30))


# --- a processing of records as the child process runs it
# ---------------------------------------------------------------

SAMPLES, RATE_HZ = 65_536, 12_800.0
FRF_BYTES = 40 * SAMPLES / 2.56  # values, variance, growth and coherence of one FRF


def _places(folder: Path, count: int) -> ProcessingInputs:
    """So many points of one hit each; on disk they all have the same samples."""
    folder.mkdir()
    rng = np.random.default_rng(1)
    t = np.arange(SAMPLES) / RATE_HZ - 0.05
    force = 80 * np.exp(-((t / 4e-4) ** 2)) + 0.05 * rng.standard_normal(SAMPLES)
    ring = np.where(
        t > 0, 80 * np.exp(-8 * t) * np.sin(1256 * t), 0.0
    ) + 0.05 * rng.standard_normal(SAMPLES)
    first = folder / "0.blocks"
    first.write_bytes(np.array([force, ring], "<f4").tobytes())
    places = []
    for number in range(1, count + 1):
        path = folder / f"{number}.blocks"
        os.link(first, path)
        rows = tuple(
            BlockRow(
                id=UUID(int=2 * number + channel),
                sha256=bytes(32),
                quantity=quantity,
                point=point,
                direction=3,
                force_point=number,
                force_direction=3,
                hit=1,
                sample_rate_hz=RATE_HZ,
                samples=SAMPLES,
                window_rate_per_s=0.0,
                full_scale=None,
                dtype="<f4",
            )
            for channel, (quantity, point) in enumerate((("force", number), ("acceleration", 999)))
        )
        places.append(PointFile(rows, path))
    return ProcessingInputs(tuple(places), Processing(windows=Windows()))


def _peak_bytes(inputs: ProcessingInputs) -> int:
    """Of a processing whose parts are taken and let go, as `store` does."""
    tracemalloc.start()
    try:
        made = 0
        for item in process_records(inputs, lambda _stage, _share: None):
            made += len(item.hits) if isinstance(item, Averages) else 0
        assert made == len(inputs.points)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_frfs_that_a_processing_makes(tmp_path: Path) -> None:
    few, many = 5, 15
    _peak_bytes(_places(tmp_path / "first", 1))  # what it imports is no part of it
    growth = _peak_bytes(_places(tmp_path / "many", many)) - _peak_bytes(
        _places(tmp_path / "few", few)
    )
    assert growth < 0.4 * (many - few) * FRF_BYTES  # all FRFs in memory, once, would be 1
    assert not list(tmp_path.rglob("*.frfs"))  # what lay on disk between the passes


# --- which hits a user's decisions mean
# ---------------------------------------------------------------------------------

HITS = [((1, -3), 1), ((1, -3), 2), ((2, 3), 1), ((2, -3), 1)]


def test_without_a_direction_the_one_is_meant_in_which_the_point_was_hit() -> None:
    left_out = OverruleIn(point=1, hit=2, use=False)
    assert decisions([left_out, left_out], HITS) == {(Dof(1, -3), 2): False}
    assert decisions([OverruleIn(point=2, direction=-3, hit=1, use=True)], HITS) == {
        (Dof(2, -3), 1): True
    }


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (OverruleIn(point=2, hit=1, use=True), r"direction: is missing: there is hit 1 of point 2 in directions -3, 3"),
        (OverruleIn(point=1, direction=3, hit=1, use=True),
         r"direction -3: hits 1 to 2; point 2, direction -3: hits 1 to 1"),
        (OverruleIn(point=1, direction=-3, hit=2, use=True),
         r"overrules.1: contradicts another about hit 2 of point 1"),
    ],
)  # fmt: skip
def test_what_means_no_hit_or_several_is_refused(wrong: OverruleIn, text: str) -> None:
    with pytest.raises(InputError, match=text):
        decisions([OverruleIn(point=1, hit=2, use=False), wrong], HITS)


def test_a_joint_update_says_of_which_campaign_something_is_missing() -> None:
    points = {label: place for label, place in measured().points.items() if label != 12}
    whole, lacking = (
        LoadedCampaign(BEAM, data, Recipe(), (), {}, name=name, specimen="bar")
        for name, data in (("March", measured()), ("April", replace(measured(), points=points)))
    )
    inputs = UpdateInputs((lacking, whole), Together(CampaignsRecipe(), (), (), {}))
    with pytest.raises(InputError, match=r"^jobs\.0\.grid_points: points 12 .*\(April\)$"):
        list(compute_update(inputs, lambda *_: None))
