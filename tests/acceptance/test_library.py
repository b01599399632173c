"""The service as a script uses it: `import modalbase`."""

import json
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import pyuff
from scipy.spatial.transform import Rotation

import modalbase
from modalbase.client.endpoint import find_endpoint, profile_file, save_profile
from modalbase.formats.models.inp import read_inp
from modalbase.formats.records import Place
from service.app.supervisor import LocalService
from service.pages.example import paper
from tests.support.laboratory import BEAM
from tests.support.lengths import long
from tests.support.profiles import ANGLE, TRUTH, askew, deck, measured, points

BODY = {**BEAM["geometry"], **BEAM["material"], "density_kg_m3": 2012.0}


@pytest.fixture
def lab(service: LocalService, api: httpx.Client) -> Iterator[modalbase.Laboratory]:
    with modalbase.connect(service.url, api.headers["authorization"].split()[1]) as found:
        yield found


@pytest.fixture
def uff(tmp_path: Path) -> Path:
    file = tmp_path / "beam.uff"
    file.write_bytes(paper.uff_file())
    return file


def test_the_main_job_reads_well(lab: modalbase.Laboratory, uff: Path, tmp_path: Path) -> None:
    beam = lab.new_project("bridge deck").new_structure("FRP beam", **BODY)
    assert beam.geometry["thickness_m"] == 0.01012
    campaign = beam.new_campaign(
        "March", "cantilever", temperature_c=21.0, sensor_mass_kg=0.002, sensor_point=1
    )
    assert campaign.instruments["sensor_mass_kg"] == 0.002
    campaign.change(temperature_c=21.5, instruments={})
    assert lab.campaign("bridge deck/FRP beam/March") == lab.campaign("latest") == campaign
    assert lab.campaign("March").temperature_c == 21.5
    read = campaign.import_file(uff)
    assert read.counts["frfs"] == 33
    assert "33 frfs" in read.summary()
    for choose in (campaign.frfs, campaign.list_frfs, campaign.records):
        with pytest.raises(
            modalbase.ClientError, match=r"no 'referense' to choose by; there is .*point"
        ):
            choose(referense=3)
    with pytest.raises(
        modalbase.ClientError,
        match=r"no 'f_max' to choose by; there is point, .*fmax, superseded, stride",
    ):
        campaign.export(tmp_path / "part.csv", f_max=900)

    modes = campaign.new_mode_set("Table 3", paper.MODES)
    np.testing.assert_array_equal(
        modes.frequency_hz, [mode["frequency_hz"] for mode in paper.MODES]
    )
    job = campaign.update({"seed": 7}, mode_set=modes)
    result = job.result()
    assert lab.job() == job
    assert [row["name"] for row in result.parameters] == [
        "Ex",
        "Ey",
        "Gxy",
        "Gxz",
        "Gyz",
        "a0",
        "a1",
    ]
    low, high = result.parameters["Ex"]["interval_95"]
    assert low < result.parameters["Ex"]["estimate"] < high
    shown = job.summary()
    assert result["verdict"]["sentence"] in shown
    assert all(f"warning: {one}" in shown for one in result.warnings)
    assert "GPa" in shown
    assert "<th>estimate</th>" in result._repr_html_()
    assert result.modes[0]["measured_hz"] == pytest.approx(25.61)
    assert "frf" in result.figures().column("name")
    assert result.figure("frf", point=7)._repr_svg_().lstrip().startswith("<?xml")
    assert result.figure("mac").save(tmp_path / "mac.pdf").read_bytes().startswith(b"%PDF")
    assert result.figure("frf").plotly()["data"]
    with pytest.raises(modalbase.ClientError, match=r"\(404\)"):
        result.figure("nonsense").plotly()
    table = lab.results(structure=beam.id)
    assert (table[0]["job"], table[0]["Ex"]) == (job.id, result.parameters["Ex"]["estimate"])
    header, line = str(table).splitlines()[-2:]
    assert header.split()[:4] == ["job", "verdict", "Ex", "[GPa]"]
    assert f" {result.parameters['Ex']['estimate'] / 1e9:.1f} " in line
    with pytest.raises(modalbase.ClientError, match=r"report\.txt"):
        job.report(tmp_path / "report.txt")
    assert b"measured mode 1" in result.shapes(tmp_path / "beam.vtu").read_bytes()
    with pytest.raises(modalbase.ClientError, match=r"no deck|deck"):
        result.deck(tmp_path / "beam.inp")
    last = list(job.events())[-1]
    assert last["status"] == "succeeded"

    frfs_travel_both_ways(lab, campaign, tmp_path)
    predicted = job.predicted(model="updated", fmax=200.0)
    assert predicted.values.shape == (33, predicted.frequency_hz.size)


def frfs_travel_both_ways(lab: modalbase.Laboratory, campaign: Any, folder: Path) -> None:
    """From the service as arrays, through pyuff's file, into a second campaign, bit for bit."""
    frfs = campaign.frfs(stride=4)
    assert frfs.values.dtype.kind == "c"
    pyuff.UFF(str(folder / "pyuff.uff")).write_sets(frfs.to_pyuff(), "overwrite")
    back = modalbase.Frfs.from_pyuff(pyuff.UFF(str(folder / "pyuff.uff")).read_sets())
    # pyuff writes single precision as text
    np.testing.assert_allclose(back.values, frfs.values, rtol=1e-4)
    second = lab.structure(campaign.structure_id).new_campaign("copy", "cantilever")
    assert len(second.add_frfs(frfs)) == 33
    again = second.frfs()
    np.testing.assert_array_equal(again.values, frfs.values)
    assert again.frfs[4].response_point == frfs.frfs[4].response_point
    assert frfs.to_sdypy()["frf"].shape == frfs.values.shape
    assert modalbase.read_uff(second.export(folder / "copy.uff"))


def test_a_script_can_be_run_twice(lab: modalbase.Laboratory) -> None:
    def script(thickness: float = 0.01012) -> list[Any]:
        beam = lab.project("twice", create=True).structure(
            "beam", create=True, **{**BODY, "thickness_m": thickness}
        )
        when = "2026-03-02T10:30:00+01:00"  # the service says 09:30Z
        march = beam.campaign(
            "March", create=True, boundary="free", performed_at=when, sensor_mass_kg=0.002
        )
        batch = beam.coupon_batch("0 degrees", create=True, constants=["Ex"])
        modes = march.mode_set("Table 3", create=True, modes=paper.MODES[::-1])
        return [
            beam,
            march,
            batch,
            modes,
            beam.monitor("ageing", create=True, parameters=[{"name": "Ex"}]),
        ]

    assert script() == script()
    with pytest.raises(
        modalbase.ClientError,
        match=r"beam' is there already.*geometry\.thickness_m is 0\.01012, not 0\.012",
    ):
        script(0.012)
    with pytest.raises(TypeError, match="create=True"):
        lab.project("twice").structure("beam", length_m=0.5)
    with pytest.warns(
        UserWarning,
        match=r"there is a project 'twice' already; lab\.project\('twice', create=True\)",
    ):
        lab.new_project("twice")
    with pytest.raises(modalbase.ClientError, match="2 projects are named 'twice'"):
        lab.project("twice", create=True)


def test_a_job_that_fails_says_why(lab: modalbase.Laboratory) -> None:
    beam = lab.new_project("fails").new_structure("beam", **BODY)
    campaign = beam.new_campaign("empty", "cantilever")
    job = campaign.update().wait()
    assert "has no FRFs" in job.summary()
    with pytest.raises(modalbase.JobFailed, match="has no FRFs") as failed:
        job.result()
    assert failed.value.job["status"] == "failed"
    with pytest.raises(modalbase.ClientError, match=r"/weigting.*\(422\)") as refused:
        campaign.update(weigting="log")
    assert refused.value.status == 422
    assert refused.value.problem["errors"][0]["pointer"] == "/weigting"
    with pytest.raises(modalbase.ClientError, match="no campaign has that name; there is 'empty'"):
        beam.campaign("emty")
    stale = lab.campaign(campaign.id)
    campaign.change(notes="first")
    with pytest.raises(modalbase.ClientError, match=r"\(412\)"):
        stale.change(notes="second")


def test_coupons_records_and_monitors(lab: modalbase.Laboratory, tmp_path: Path) -> None:
    beam = lab.new_project("more").new_structure("beam", **BODY)
    batch = beam.new_coupon_batch("0 degrees", ["Ex"])
    lines = ["Load (kN),Strain (%)", *(f"{0.4 * i:.3f},{0.02 * i:.4f}" for i in range(51))]
    (tmp_path / "A1.csv").write_text("\n".join(lines))
    batch.add_curve(
        tmp_path / "A1.csv",
        dimensions={"unit": "mm", "width": [25], "thickness": [2]},
        columns={"force": "Load", "strain": "Strain"},
    )
    assert batch.coupons()["A1"]["E_Pa"] == pytest.approx(40e9, rel=1e-9)  # 400 N / 50 mm² / 200 µε
    assert batch.curve("A1")["force"].max() == pytest.approx(20e3)
    monitor = beam.new_monitor("ageing", parameters=[{"name": "Ex"}])
    assert lab.monitor("ageing") == monitor
    assert monitor.alarms() == []
    assert len(monitor.runs()) == 0
    for day in (1, 2):
        campaign = beam.new_campaign(f"day {day}", "free", performed_at=f"2024-01-0{day}T10:00:00Z")
        campaign.new_mode_set("typed", modes=[{"frequency_hz": 40.0 + day, "damping_ratio": 0.01}])
    modes = beam.new_monitor("modes", watch="modes", runs_on="hand", baseline={"campaigns": 4})
    assert len(modes.run()) == 2
    assert [one["state"] for one in modes.wait().runs()] == ["succeeded"] * 2
    assert modes.series()["assessed_at"] is not None


def test_time_series_of_sep_5_go_in_and_come_back(lab: modalbase.Laboratory) -> None:
    campaign = (
        lab.new_project("series").new_structure("beam", **BODY).new_campaign("hammer", "free")
    )
    time = np.arange(1024) / 2048
    noise = 1e-3 * np.random.default_rng(5).standard_normal((2, 3, 1024))
    force = 50 * np.exp(-(((time - 0.05) / 1e-3) ** 2)) + noise[0]
    response = (
        np.where(time > 0.05, np.exp(-20 * (time - 0.05)) * np.sin(400 * time), 0.0) + noise[1]
    )
    series = [
        {"name": "hammer", "data": force, "fs": 2048, "unit_str": "N"},
        {"name": "acc", "data": response, "fs": 2048, "unit_str": "g"},
    ]
    places = {"hammer": 4, "acc": Place(33, -3)}
    answer = campaign.add_sep005(series, places)
    assert [(hit["point"], hit["hit"]) for hit in answer["hits"]] == [(4, 1), (4, 2), (4, 3)]
    again = campaign.add_sep005(series, places, hit=8)  # numbered, and behind them
    assert {item["hit"] for item in again["items"]} == {8, 9, 10}
    back = [record.sep005() for record in campaign.records()]
    own = [one for one in back if one["name"] == "acc" and one["hit"] == 2]
    assert [(one["point"], one["direction"], one["force_point"], one["fs"]) for one in own] == [
        (33, -3, 4, 2048.0)
    ]
    np.testing.assert_allclose(own[0]["data"], 9.80665 * response[1], rtol=1e-12)
    with pytest.raises(modalbase.ClientError, match="hit 8 of point 4 is in the campaign already"):
        campaign.add_sep005(series, places, hit=8)
    for hit in ((4, 2), answer["hits"][1], next(r for r in campaign.records() if r.hit == 2)):
        decision = campaign.judge(hit, good=False, why="a cable was touched")
        assert (decision["point"], decision["direction"], decision["hit"], decision["good"]) == (
            4,
            3,
            2,
            False,
        )
    back = campaign.judge((4, 2), good=None, why="it was another's")
    assert [one["good"] for one in campaign.hit_decisions()] == [None, False, False, False]
    assert campaign.hit_decisions()[0] == back
    with pytest.raises(modalbase.ClientError, match="hit 7 of point 4, which does not exist"):
        campaign.judge((4, 7), good=True, why="x")


def test_a_bar_in_a_notebook_needs_no_widgets(
    lab: modalbase.Laboratory, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[str] = []

    class ZMQInteractiveShell:
        pass

    def display(text: str, *, display_id: bool) -> types.SimpleNamespace:
        assert display_id
        shown.append(text)
        return types.SimpleNamespace(update=shown.append)

    ipython: Any = types.ModuleType("IPython")
    ipython.get_ipython = ZMQInteractiveShell
    ipython.display = types.SimpleNamespace(HTML=str, display=display)
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    job = (
        lab.new_project("bars")
        .new_structure("beam", **BODY)
        .new_campaign("c", "cantilever")
        .update()
        .wait()
    )
    assert all(text.startswith("<progress") for text in shown)
    assert shown[-1].endswith(f"update: {job.stage or job.status}")


def test_where_the_service_and_its_key_are_looked_for(
    service: LocalService, api: httpx.Client, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    key = api.headers["authorization"].split()[1]
    for name in ("MODALBASE_URL", "MODALBASE_API_KEY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MODALBASE_PROFILE", str(tmp_path / "profiles" / "profile.json"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with pytest.raises(modalbase.ClientError, match="no API key"):
        modalbase.connect(service.url)
    assert save_profile(service.url, key).stat().st_mode & 0o077 == 0
    with modalbase.connect() as found:
        assert found.connection.url == service.url
    monkeypatch.setenv("MODALBASE_API_KEY", "wrong")
    with pytest.raises(modalbase.ClientError, match=r"\(401\)"):
        modalbase.connect()
    monkeypatch.delenv("MODALBASE_API_KEY")
    monkeypatch.setenv("MODALBASE_URL", "http://elsewhere.example:1")
    # the profile's is not for that address
    with pytest.raises(modalbase.ClientError, match="no API key"):
        find_endpoint()
    monkeypatch.delenv("MODALBASE_URL")
    profile_file().write_text("{")
    with pytest.raises(modalbase.ClientError, match="modalbase login"):
        modalbase.connect()
    profile_file().unlink()
    the_service_that_runs_here(tmp_path)


def the_service_that_runs_here(folder: Path) -> None:
    """`modalbase up` notes where it is; its data folder has the key that it made."""
    from modalbase.client.endpoint import KEY_FILE, notes_folder
    from service.app.running import announced, running_services

    data = folder / "data"
    data.mkdir()
    (data / KEY_FILE).write_text("mb_local\n")
    assert str(notes_folder()).startswith(str(folder))
    with announced("http://127.0.0.1:4711", data):
        place = find_endpoint()
        assert (place.url, place.key) == ("http://127.0.0.1:4711", "mb_local")
        (notes_folder() / "1.json").write_text(
            json.dumps({"pid": 1, "url": "http://127.0.0.1:4712", "data": None})
        )
        with pytest.raises(modalbase.ClientError, match="2 services run here"):
            find_endpoint()
        # the service's own commands clear the note that names no process of its own away
        assert [one.url for one in running_services()] == ["http://127.0.0.1:4711"]
        assert not (notes_folder() / "1.json").exists()


@pytest.mark.parametrize("planned", [False, long(True)])
def test_a_profile_is_stated_by_its_shape(lab: modalbase.Laboratory, planned: bool) -> None:
    """A test of a beam is planned in the short run, of the profile in the long one."""
    sizes = {
        "length_m": 0.4,
        "width_m": 0.06,
        "height_m": 0.08,
        "flange_thickness_m": 0.004,
        "web_thickness_m": 0.004,
    }
    stated = {"shape": "angle", "density_kg_m3": 1850, **sizes, **ANGLE["shape"]["material"]}
    project = lab.new_project("profiles")
    angle = project.new_structure("angle", thickness_sd_m=5e-5, **stated)
    assert angle.shape["walls"]["web"]["thickness_m"] == 0.004
    assert angle.inputs["thickness_sd_m"] == 5e-5
    assert project.structure("angle", create=True, **stated) == angle
    if planned:
        (plan,) = angle.plan([{"boundary": "free", "highest_hz": 300}], about="web.E1")
        assert 0 < plan["expected_sd"]["web.E1"] < 0.3 * 23e9  # of the prior
    else:
        (plan,) = project.new_structure("beam", **BODY).plan([{"boundary": "free"}])
        assert 0 < plan["expected_sd"]["Ex"] < 0.3 * BODY["Ex_Pa"]
    with pytest.raises(modalbase.ClientError, match="height"):
        project.structure("angle", create=True, **{**stated, "height_m": 0.09})


def test_a_deck_goes_in_and_comes_back(lab: modalbase.Laboratory, tmp_path: Path) -> None:
    file = tmp_path / "angle.inp"
    file.write_bytes(deck(1e-3))
    bracket = lab.new_project("decks").new_structure("bracket")
    assert bracket.model is None
    with pytest.raises(modalbase.JobFailed, match="units=mm-N-t"):
        bracket.import_model(file)
    model = bracket.import_model(file, units="mm-N-t")
    assert bracket.version == 2
    assert bracket.model == model
    assert model.sets["web"]["thickness_m"] == 0.004
    assert "flange" in model.summary()
    assert b"<!-- set 1: web -->" in bracket.mesh(tmp_path / "mesh.vtu").read_bytes()
    wall = {"thickness_m": 0.004, "material": {**ANGLE["shape"]["material"], "density_kg_m3": 1850}}
    meshed = lab.project("decks").new_structure("mesh")
    with pytest.raises(modalbase.JobFailed, match=r"lack web \(80 elements\)"):
        meshed.import_model(tmp_path / "mesh.vtu", "m-N-kg", sections={"flange": wall})
    again = meshed.import_model(
        tmp_path / "mesh.vtu", "m-N-kg", sections={"flange": wall, "web": wall}
    )
    assert again.sets["web"]["mass_kg"] == pytest.approx(model.sets["web"]["mass_kg"])
    assert model.save(tmp_path / "copy.inp").read_bytes() == file.read_bytes()


@pytest.mark.long
def test_an_updated_deck_comes_back(lab: modalbase.Laboratory, tmp_path: Path) -> None:
    """The short forms are the deck above, those of `integration/test_models.py`, and the shapes of
    the main job.
    """
    file, back = tmp_path / "angle.inp", tmp_path / "updated.inp"
    file.write_bytes(deck(1e-3))
    bracket = lab.new_project("decks").new_structure("bracket")
    bracket.import_model(file, units="mm-N-t")
    uff = tmp_path / "angle.uff"
    uff.write_bytes(measured())
    campaign = bracket.new_campaign("free", "free", window_rate_per_s=0)
    campaign.import_file(uff)
    few = {"identification": {"band_hz": [5, 395]}, "damping_models": ["rayleigh"]}
    result = campaign.update(parameters=[{"name": "web.E1"}], **few).result()
    updated = read_inp(result.deck(back).read_bytes())
    assert b"measured mode 1, expanded" in result.shapes(back.with_suffix(".vtu")).read_bytes()
    (name,) = updated.sections["web"].materials
    assert updated.materials[name].constants["E1"] == pytest.approx(
        result.parameters["web.E1"]["estimate"] / 1e6
    )


@pytest.mark.long
def test_a_test_in_a_frame_askew_is_brought_onto_its_structure(lab: modalbase.Laboratory) -> None:
    """Directions stay the file's, and count along their own vectors in the structure's frame."""
    turn, shift = Rotation.from_rotvec([0.2, -0.4, 1.1]).as_matrix(), np.array([0.3, -0.2, 0.5])
    sizes = {
        "length_m": 0.4,
        "width_m": 0.06,
        "height_m": 0.08,
        "flange_thickness_m": 0.004,
        "web_thickness_m": 0.004,
    }
    angle = lab.new_project("askew").new_structure(
        "angle", shape="angle", density_kg_m3=1850, **sizes, **ANGLE["shape"]["material"]
    )
    campaign = angle.new_campaign("free", "free", window_rate_per_s=0)
    places = points()
    moved = {n: turn @ (np.array(xyz) - shift) for n, xyz in places.items()}
    campaign.set_grid_points([(n, *map(float, xyz)) for n, xyz in moved.items()])
    campaign.add_frfs(askew(turn))
    assert all(row["off"] for row in campaign.alignment())
    with pytest.raises(modalbase.ClientError, match="pairs"):
        campaign.align({n: places[n] for n in (1, 3)})
    found = campaign.align({n: places[n] for n in (1, 2, 8, 14)})
    assert found["frames"][0]["rms_m"] < 1e-9
    assert not any(row["off"] for row in campaign.alignment())
    result = campaign.update(damping_models=["rayleigh"]).result()
    for name in ("flange.E1", "web.E1"):
        low, high = result.parameters[name]["interval_95"]
        assert low < TRUTH[name] < high
    assert min(mode["mac"] for mode in result["modes"] if mode["mac"] is not None) > 0.99
