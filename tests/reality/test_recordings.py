"""Recordings as laboratories send them: units, names and start times of the file count, and what it
lacks is asked for.
"""

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from modalbase.formats.records import TimeBlock, propose, read_variables
from service.nouns.records.schemas import Proposal
from service.pages.measurements import _overruling
from service.platform.errors import Invalid
from service.tasks.import_file.arrays_of_files import FileDescription, hits_of
from service.tasks.import_file.compute import Kept
from tests.support.reality import kept, reality
from tests.unit.fecore.signal.test_recording import RATE, recording

nptdms = pytest.importorskip(
    "nptdms", reason="npTDMS is not installed: pip install 'modalbase[tdms]'"
)
POUND, GRAVITY = 4.4482216152605, 9.80665


def proposed(path: Path) -> dict[str, Any]:
    (found,) = kept(path, dry_run=True)
    assert isinstance(found, FileDescription)
    return found.mapping


def placed(mapping: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """The proposal with what it asks for: hit at point 1, response at 2, along z; and changes of
    the second channel.
    """
    mapping = deepcopy(mapping)
    for point, channel in enumerate(mapping["channels"], 1):
        channel.update(point=point, direction=3)
    mapping["channels"][1].update(changes)
    return mapping


def blocks_in(items: list[Kept]) -> list[TimeBlock]:
    return [item for item in items if isinstance(item, TimeBlock)]


def peaks(items: list[Kept], quantity: str) -> list[float]:
    return [float(np.abs(b.samples).max()) for b in blocks_in(items) if b.quantity == quantity]


def first_frf(items: list[Kept], hz: float) -> float:
    """|H21| of the first hit at a frequency."""
    force, response = (np.asarray(block.samples, dtype=float) for block in blocks_in(items)[:2])
    times = np.arange(force.size) / blocks_in(items)[0].sample_rate_hz
    at = np.exp(-2j * np.pi * hz * times)
    return float(
        abs(at @ (response - response[:200].mean())) / abs(at @ (force - force[:200].mean()))
    )


def fault_of(path: Path, mapping: dict[str, Any]) -> str:
    with pytest.raises(Invalid) as refused:
        kept(path, mapping)
    return "; ".join(f"{fault.pointer}: {fault.detail}" for fault in refused.value.faults)


def test_g_and_lbf_of_a_tdms_are_used() -> None:
    path = reality("rec_g_lbf.tdms")
    mapping = proposed(path)
    assert [(c["quantity"], c["unit"], "sensitivity" in c) for c in mapping["channels"]] == [
        ("force", "lbf", False),
        ("acceleration", "g", False),
    ]
    items = kept(path, placed(mapping))
    assert len(blocks_in(items)) == 8
    assert all(95 < peak < 113 for peak in peaks(items, "force"))
    assert 2.0 < first_frf(items, 31.0) < 2.51


def test_a_proposal_that_is_sent_as_it_came_is_refused_and_names_what_is_empty() -> None:
    path = reality("rec_g_lbf.tdms")
    fault = fault_of(path, proposed(path))
    for number in (0, 1):
        for member in ("point", "direction"):
            assert f"/mapping/channels/{number}/{member}: is empty" in fault


def test_a_recording_of_one_hit_says_so_and_is_taken_as_one_hit() -> None:
    path = reality("rec_one_hit.tdms")
    mapping = placed(proposed(path))
    fault = fault_of(path, mapping)
    assert "holds 1 hit, at 0.02 s (95.4 N)" in fault
    assert "leave `recording` out" in fault
    alone = {name: value for name, value in mapping.items() if name != "recording"}
    force, response = blocks_in(kept(path, alone))
    assert (force.force_point, response.point, force.hit, force.samples.size) == (1, 2, 1, 4096)
    assert np.abs(force.samples).max() == pytest.approx(95.4, rel=1e-3)


def test_channels_that_begin_at_different_times_are_aligned() -> None:
    path = reality("rec_start_offset.tdms")
    items = kept(path, placed(proposed(path)))
    assert isinstance(items[0], FileDescription)
    assert any("begins 20 samples (9.766 ms) after Log/Hammer" in note for note in items[0].notes)
    force, response = blocks_in(items)[:2]
    hit = int(np.argmax(np.abs(force.samples)))
    moved = int(np.argmax(np.abs(response.samples) > 0.2 * np.abs(response.samples).max()))
    assert -5 <= moved - hit <= 5  # it was 20 samples before the hit
    assert 2.0 < first_frf(items, 31.0) < 2.51


# --- variants that are made here
# --------------------------------------------------------------------------------------


def made(folder: Path, names: tuple[str, str], *properties: dict[str, Any], late: int = 0) -> Path:
    """Two hits of 1 N in TDMS; the response begins so many samples late."""
    path = folder / "made.tdms"
    force, response = recording([1.0, 4.0], [1.0, 0.6], 7.0)
    with nptdms.TdmsWriter(path) as file:
        rows = (force[: force.size - late], response[late:])
        file.write_segment(
            [
                nptdms.ChannelObject("Log", name, row, {"wf_increment": 1 / RATE, **own})
                for name, row, own in zip(names, rows, properties, strict=True)
            ]
        )
    return path


@pytest.mark.parametrize(
    ("names", "units", "factor"),
    [
        (("Hammer", "ACC"), ("N", "m/s^2"), 1.0),
        (("Hammer", "ACC"), ("kN", "mm/s2"), 1e-6),
        (("Hammer [lbf]", "ACC (g)"), (None, None), GRAVITY / POUND),
        (("Hammer [lbf]", "ACC (g)"), ("LBF", "G"), GRAVITY / POUND),
        (("ch 1", "ch 2"), ("N", "in/s²"), 0.0254),
        (("force_N", "acc_g"), (None, None), GRAVITY),
        (("force [N]", "vel. {ips}"), (None, None), 0.0254),
    ],
)
def test_units_of_properties_and_names_are_used(
    tmp_path: Path, names: tuple[str, str], units: tuple[str | None, str | None], factor: float
) -> None:
    path = made(tmp_path, names, *({"unit_string": unit} if unit else {} for unit in units))
    force, response = blocks_in(kept(path, placed(proposed(path))))[:2]
    plain = made(tmp_path, ("Hammer", "ACC"), {"unit_string": "N"}, {"unit_string": "m/s^2"})
    same_force, same = blocks_in(kept(plain, placed(proposed(plain))))[:2]
    ratio = np.abs(response.samples).max() / np.abs(force.samples).max()
    expected = factor * np.abs(same.samples).max() / np.abs(same_force.samples).max()
    assert ratio == pytest.approx(expected, rel=1e-5)


def test_volts_ask_for_a_sensitivity_and_take_one_with_its_unit(tmp_path: Path) -> None:
    path = made(tmp_path, ("Hammer", "ACC"), {"unit_string": "N"}, {"unit_string": "mV"})
    mapping = proposed(path)
    assert (mapping["channels"][1]["unit"], mapping["channels"][1]["sensitivity"]) == ("mV", None)
    assert "/channels/1/sensitivity: is missing: the file is in 'mV', volts" in fault_of(
        path, placed(mapping)
    )
    assert 'state "100 mV/(m/s²)" or "100 V/(m/s²)"' in fault_of(
        path, placed(mapping, sensitivity=100)
    )
    by_text, in_volts = (
        blocks_in(kept(path, placed(mapping, sensitivity=text)))[1].samples
        for text in ("100 mV/g", "0.1 V/g")
    )
    np.testing.assert_allclose(by_text, in_volts, rtol=1e-12)
    (raw,) = (
        b
        for b in blocks_in(kept(path, placed(mapping, sensitivity="1 mV/(m/s²)")))
        if b.hit == 1 and b.point == 2
    )
    np.testing.assert_allclose(by_text, raw.samples * GRAVITY / 100, rtol=1e-6)


@pytest.mark.parametrize(
    ("unit", "changes", "fault"),
    [
        ("g", {"sensitivity": 1.0}, "is 1.0, and the unit 'g' says that the samples are no volts"),
        ("g", {"sensitivity": "100 mV/g"}, "is '100 mV/g', and the unit 'g' says"),
        ("g", {"unit": "m/s^2"}, "is 'm/s^2', and the file states 'g'"),
        (
            "lbf",
            {"quantity": "acceleration"},
            "is 'acceleration', and the unit 'lbf' is a unit of force",
        ),
        ("g", {"unit": "V", "instead_of": "mV"}, "is 'mV', and the file states 'g'"),
        ("EU", {}, "the file is in 'EU', no unit that is known here"),
        ("pC", {}, "the file is in 'pC', no unit that is known here"),
        ("m/s²", {"unit": "furlong"}, "is 'furlong', which is no unit that is known here"),
        (None, {}, "is empty: the file states no unit"),
    ],
)
def test_what_contradicts_or_lacks_is_refused_with_both(
    tmp_path: Path, unit: str | None, changes: dict[str, Any], fault: str
) -> None:
    path = made(
        tmp_path, ("Hammer", "ACC"), {"unit_string": "N"}, {"unit_string": unit} if unit else {}
    )
    mapping = proposed(path)
    mapping["channels"][1]["quantity"] = "acceleration"
    if changes:
        mapping["channels"][1].pop("unit", None)
    assert fault in fault_of(path, placed(mapping, **changes))


def test_a_wrong_unit_of_a_file_is_overruled_by_naming_it(tmp_path: Path) -> None:
    path = made(tmp_path, ("Hammer", "ACC"), {"unit_string": "Volts"}, {"unit_string": "g"})
    mapping = placed(proposed(path))
    mapping["channels"][0] |= {"unit": "N", "instead_of": "Volts", "sensitivity": None}
    assert peaks(kept(path, mapping), "force")[0] == pytest.approx(1.0, rel=0.05)


def test_a_page_overrules_the_unit_that_it_shows() -> None:
    """What a person types in the place of a unit is sent with the file's own beside it."""
    found = Proposal(
        variables={}, mapping=propose({"ACC (g)": np.zeros(99), "force": np.zeros(99)}), blocks=None
    )
    stated = {
        "channels": [{"variable": "ACC (g)", "unit": "m/s²"}, {"variable": "force", "unit": "N"}]
    }
    shown = _overruling(stated, found)["channels"]
    assert [(c["unit"], c["instead_of"]) for c in shown] == [("m/s²", "g"), ("N", None)]
    assert _overruling({"frf": {}}, found) == {"frf": {}}


def test_a_name_that_contradicts_the_property_is_asked_for(tmp_path: Path) -> None:
    path = made(tmp_path, ("Hammer", "ACC (g)"), {"unit_string": "N"}, {"unit_string": "m/s^2"})
    mapping = proposed(path)
    assert mapping["channels"][1]["unit"] is None
    assert "is stated in the file as 'm/s^2' and 'g'" in fault_of(path, placed(mapping))
    assert len(blocks_in(kept(path, placed(mapping, unit="g")))) == 4


@pytest.mark.parametrize("which", ["wf_start_offset", "wf_start_time"])
@pytest.mark.parametrize("late", [1, 37])
def test_offsets_and_start_times_align(tmp_path: Path, which: str, late: int) -> None:
    units: tuple[dict[str, Any], ...] = ({"unit_string": "N"}, {"unit_string": "m/s^2"})
    whole = blocks_in(
        kept(path := made(tmp_path, ("Hammer", "ACC"), *units), placed(proposed(path)))
    )
    if which == "wf_start_offset":
        starts: list[dict[str, Any]] = [{which: 0.0}, {which: late / RATE}]
    else:
        first = np.datetime64("2024-03-03T10:00:00.000000", "us")
        starts = [{which: first}, {which: first + np.timedelta64(round(late / RATE * 1e6), "us")}]
    both = [{**unit, **start} for unit, start in zip(units, starts, strict=True)]
    again = blocks_in(
        kept(path := made(tmp_path, ("Hammer", "ACC"), *both, late=late), placed(proposed(path)))
    )
    assert len(again) == len(whole)
    for one, other in zip(again, whole, strict=True):
        n = min(one.samples.size, other.samples.size)
        np.testing.assert_allclose(one.samples[:n], other.samples[:n], atol=1e-5)


def test_a_start_between_two_samples_is_refused_by_name(tmp_path: Path) -> None:
    units = ({"unit_string": "N"}, {"unit_string": "m/s^2", "wf_start_offset": 2.5 / RATE})
    path = made(tmp_path, ("Hammer", "ACC"), *units)
    assert "2.5 samples: they can be aligned by whole samples alone" in fault_of(
        path, placed(proposed(path))
    )


def test_names_of_arrays_and_of_their_time_axis_state_units(tmp_path: Path) -> None:
    force, response = recording([1.0], [1.0], 3.0)
    path = tmp_path / "hits.npz"
    np.savez(
        path,
        **{
            "Hammer [lbf]": force,
            "ACC (g)": response,
            "time_ms": np.arange(force.size) * 1e3 / RATE,
        },
    )
    variables = read_variables(path)
    mapping = propose(variables)
    assert mapping["sample_rate_hz"] == {"variable": "time_ms"}
    assert [(c["quantity"], c["unit"]) for c in mapping["channels"]] == [
        ("force", "lbf"),
        ("acceleration", "g"),
    ]
    _, (hit, moved) = hits_of(variables, placed(mapping), dry_run=False)
    assert hit.sample_rate_hz == pytest.approx(RATE)
    np.testing.assert_allclose(hit.samples, force * POUND, rtol=1e-12)
    np.testing.assert_allclose(moved.samples, response * GRAVITY, rtol=1e-12)


def test_a_file_without_units_says_nothing_of_them() -> None:
    force, response = recording([1.0], [1.0], 3.0)
    mapping = propose({"force": force, "resp_2": response, "fs": np.array(RATE)})
    named = {c["variable"]: c for c in mapping["channels"]}
    empty = {"unit": None, "sensitivity": None, "point": None, "direction": None}
    assert {k: named["force"][k] for k in empty} == empty
    assert named["resp_2"]["quantity"] is None


def test_a_text_beside_an_array_of_a_mat_states_its_unit(tmp_path: Path) -> None:
    force, response = recording([1.0], [1.0], 3.0)
    path = tmp_path / "hit.mat"
    channel = {"values": response, "quantity": {"label": "g"}}
    savemat(path, {"fs": RATE, "hammer": {"data": force, "unit": "lbf"}, "acc": channel})
    mapping = proposed(path)
    assert {c["variable"]: c["unit"] for c in mapping["channels"]} == {
        "hammer.data": "lbf",
        "acc.values": "g",
    }
    hit, moved = blocks_in(kept(path, placed(mapping)))
    np.testing.assert_allclose(hit.samples, force * POUND, rtol=1e-12)
    np.testing.assert_allclose(moved.samples, response * GRAVITY, rtol=1e-12)


def test_the_unit_of_the_axis_of_a_tdms_is_used(tmp_path: Path) -> None:
    axis = {"wf_increment": 1e3 / RATE, "wf_xunit_string": "ms"}
    path = made(
        tmp_path, ("Hammer", "ACC"), {"unit_string": "N", **axis}, {"unit_string": "g", **axis}
    )
    assert blocks_in(kept(path, placed(proposed(path))))[0].sample_rate_hz == pytest.approx(RATE)


def test_a_channel_may_be_the_time_axis_of_a_tdms(tmp_path: Path) -> None:
    path = tmp_path / "made.tdms"
    force = np.zeros(512)
    force[40:44] = 10.0
    columns = {
        "Time": (np.arange(512) / RATE, "s"),
        "Hammer": (force, "N"),
        "ACC": (np.roll(force, 2), "g"),
    }
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(
            [nptdms.ChannelObject("Log", n, a, {"unit_string": u}) for n, (a, u) in columns.items()]
        )
    mapping = placed(proposed(path), sensitivity=None)
    assert [c["variable"] for c in mapping["channels"]] == ["Log/Hammer", "Log/ACC"]
    mapping = {"channels": mapping["channels"], "sample_rate_hz": {"variable": "Log/Time"}}
    assert blocks_in(kept(path, mapping))[0].sample_rate_hz == pytest.approx(RATE)


def test_what_cannot_be_read_of_a_tdms_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "made.tdms"
    linear = {
        "Scale_Type": "Linear",
        "Linear_Slope": 0.1,
        "Linear_Y_Intercept": 0.0,
        "Linear_Input_Source": 0,
    }
    scale = {
        "NI_Number_Of_Scales": 2,
        **{f"NI_Scale[1]_{name}": value for name, value in linear.items()},
    }
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(
            [nptdms.ChannelObject("Log", "Hammer", np.arange(512, dtype=np.int16), scale)]
        )
    with pytest.raises(
        Invalid, match="it is damaged, or scaled in a way that is not known here; export it anew"
    ):
        kept(path, dry_run=True)


SECONDS = np.arange(64) / 2048
HIT, ANSWER = np.eye(1, 64, 3)[0], np.sin(np.arange(64.0))


@pytest.mark.parametrize(
    "arrays",
    [
        lambda late: {
            "Hammer": {"t": SECONDS, "y": HIT, "units": "N"},
            "Acc": {"t": SECONDS + late, "y": ANSWER, "units": "g"},
        },
        lambda late: {
            "Hammer": {"x": {"start_value": 0.0}, "y": {"values": HIT, "unit": "N"}},
            "Acc": {"x": {"start_value": late}, "y": {"values": ANSWER, "unit": "g"}},
        },
        lambda late: {
            "Data1_Hammer": HIT,
            "Data1_time_Hammer": SECONDS,
            "Data1_Acc": ANSWER,
            "Data1_time_Acc": SECONDS + late,
        },
    ],
)
def test_arrays_on_two_clocks_are_refused(tmp_path: Path, arrays: Any) -> None:
    for late in (0.0, 0.01):
        savemat(path := tmp_path / "two.mat", arrays(late))
        mapping = {**placed(proposed(path), unit="g"), "sample_rate_hz": 2048}
        mapping["channels"][0].update(unit="N")
        for channel in mapping["channels"]:
            channel.pop("sensitivity", None)
        if late:
            assert "export them over the same times" in fault_of(path, mapping)
        else:
            assert len(blocks_in(kept(path, mapping))) == 2


def test_packed_numbers_and_tables_of_hdf5(tmp_path: Path) -> None:
    """Integers with the `scale_factor` and `add_offset` of netCDF, and a dataset of columns."""
    h5py = pytest.importorskip("h5py")
    packed, columns, structured = (tmp_path / name for name in ("packed.h5", "columns.h5", "s.npz"))
    with h5py.File(packed, "w") as file:
        for name, values, unit in (("Hammer", HIT, "N"), ("Acc", ANSWER, "g")):
            own = file.create_dataset(name, data=np.round(values * 1000 - 500).astype(np.int16))
            own.attrs.update({"Unit": unit, "scale_factor": 1e-3, "add_offset": 0.5})
    table = np.rec.fromarrays([HIT, ANSWER], names="hammer,acc")
    with h5py.File(columns, "w") as file:
        file["daq"] = table
    np.savez(structured, daq=table)
    for path in (packed, columns, structured):
        mapping = {**placed(proposed(path), unit="g"), "sample_rate_hz": 2048}
        mapping["channels"][0].update(unit="N")
        for channel in mapping["channels"]:
            channel.pop("sensitivity", None)
        force, response = blocks_in(kept(path, mapping))
        np.testing.assert_allclose(force.samples, HIT, atol=1e-6)
        np.testing.assert_allclose(response.samples, 9.80665 * ANSWER, atol=1e-2)


CLOCKS = [
    ({"start_time": (0.0, 0.0), "sample_rate": (2048.0, 2048.0)}, ""),
    (
        {"start_time": (0.0, 0.25), "sample_rate": (2048.0, 2048.0)},
        "export them over the same times",
    ),
    (
        {"sample_rate": (2048.0, 1024.0)},
        "daq.Hammer@sample_rate is 2048 and daq.Acc@sample_rate is 1024",
    ),
]


@pytest.mark.parametrize(("clocks", "why"), CLOCKS)
def test_attributes_of_each_channel_state_its_clock(
    tmp_path: Path, clocks: dict[str, tuple[float, float]], why: str
) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for k, (name, values, unit) in enumerate((("Hammer", HIT, "N"), ("Acc", ANSWER, "g"))):
            own = file.create_dataset(f"daq/{name}", data=values)
            own.attrs.update({"unit": unit, **{what: pair[k] for what, pair in clocks.items()}})
    mapping = placed(proposed(path))
    if why:
        assert why in fault_of(path, mapping)
    else:
        assert [block.sample_rate_hz for block in blocks_in(kept(path, mapping))] == [2048.0] * 2


def test_an_axis_that_counts_days_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    days = 739_000.5 + np.arange(HIT.size) / 2048 / 86_400
    np.savez(path, time=days, hammer_N=HIT, acc_g=ANSWER)
    mapping = placed(proposed(path))
    assert "state it as a number where a time axis counts days" in fault_of(path, mapping)
    blocks = blocks_in(kept(path, {**mapping, "sample_rate_hz": 2048}))
    assert [block.sample_rate_hz for block in blocks] == [2048.0] * 2
