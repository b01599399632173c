"""Time blocks over HTTP: take in, list, judge after each hit, process to FRFs, delete."""

import io
import json
from typing import Any
from uuid import UUID, uuid4

import h5py
import httpx
import numpy as np
import pytest
from scipy.io import savemat

from fecore.signal import by_point, inspect
from service.app.supervisor import LocalService
from service.nouns.frfs.data import load_measured_campaign
from service.platform.db.engine import make_engine, make_sessions
from tests.support.hammer import Bench, Simulated, random_body, random_laboratory
from tests.support.hammer import campaign as simulated_campaign
from tests.support.rest import ok
from tests.support.tables import parquet_rows
from tests.support.uff import axis, set_58
from tests.support.waiting import until

MAPPING: dict[str, Any] = {
    "sample_rate_hz": {"variable": "fs"},
    "hit": {"variable": "hit"},
    "channels": [
        {
            "variable": "force",
            "quantity": "force",
            "point": {"variable": "point"},
            "sensitivity": 0.002,
        },
        {"variable": "acceleration", "quantity": "acceleration", "point": 99, "sensitivity": 0.01},
    ],
}


@pytest.fixture(scope="module")
def hits() -> list[Simulated]:
    return simulated_campaign(np.random.default_rng(12), "free", 3, 4, 0.3, 0.0)[2]


def arrays(hits: list[Simulated]) -> dict[str, np.ndarray[Any, Any]]:
    return {
        "force": np.array([s.hit.force.samples * 0.002 for s in hits]),
        "acceleration": np.array([s.hit.responses[0].samples * 0.01 for s in hits]),
        "point": np.array([s.hit.force.dof.point for s in hits]),
        "hit": np.array([s.hit.number for s in hits]),
        "fs": np.array(hits[0].hit.sample_rate_hz),
    }


def npz(hits: list[Simulated]) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays(hits))
    return file.getvalue()


def post(
    api: httpx.Client, campaign: str, data: bytes, name: str = "hits.npz", **query: Any
) -> httpx.Response:
    params = {"filename": name, "mapping": json.dumps(MAPPING), **query}
    headers = {"Content-Type": "application/octet-stream"}
    return api.post(f"campaigns/{campaign}/records", content=data, params=params, headers=headers)


def processed(api: httpx.Client, campaign: str, body: dict[str, Any]) -> dict[str, Any]:
    started = ok(api.post(f"campaigns/{campaign}/processings", json=body), 202)

    def ended() -> dict[str, Any] | None:
        row: dict[str, Any] = ok(api.get(f"processings/{started['id']}"), 200)
        return row if row["status"] not in ("queued", "running") else None

    return until(ended, "the processing")


def test_records_become_frfs_and_each_names_its_hits(
    service: LocalService, api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    stored = ok(post(api, campaign, npz(hits)), 201)["items"]
    assert len(stored) == 2 * len(hits)
    listed = ok(api.get(f"campaigns/{campaign}/records", params={"point": 1}), 200)["items"]
    assert {row["force_point"] for row in listed} == {1}
    row = next(r for r in stored if r["quantity"] == "force")
    samples = ok(api.get(f"records/{row['id']}/data"), 200)["samples"]
    np.testing.assert_allclose(samples, hits[0].hit.force.samples, rtol=1e-12, atol=1e-12)
    with np.load(
        io.BytesIO(api.get(f"records/{row['id']}/data", params={"format": "npz"}).content)
    ) as file:
        np.testing.assert_array_equal(file["samples"], samples)
        time = file["time_s"]
    accepted = {"Accept": "application/x-hdf5"}
    content = api.get(f"records/{row['id']}/data", headers=accepted).content
    with h5py.File(io.BytesIO(content)) as made:
        np.testing.assert_array_equal(made["samples"], samples)
    content = api.get(f"records/{row['id']}/data", params={"format": "parquet"}).content
    assert [each["samples"] for each in parquet_rows(content)] == samples
    table = api.get(f"records/{row['id']}/data", params={"format": "csv"}).text
    assert table.startswith("time_s,force\n")
    np.testing.assert_allclose(
        np.loadtxt(io.StringIO(table), delimiter=",", skiprows=1).T, [time, samples], rtol=1e-8
    )

    done = processed(api, campaign, {})
    assert done["status"] == "succeeded", done
    result = done["result"]
    judged = {(h["point"], h["hit"]): h["accepted"] for h in result["hits"]}
    truth = {
        (s.hit.force.dof.point, s.hit.number): s.fault is None
        for s in hits
        if s.fault != "off_place"
    }
    assert {key: judged[key] for key in truth} == truth
    frfs = ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]
    assert {f["id"] for f in frfs} == {f["id"] for f in result["frfs"]}
    assert all(f["processing_id"] == done["id"] and f["has_coherence"] for f in frfs)
    known = {r["id"]: r["sha256"] for r in stored}
    for frf in result["frfs"]:
        assert len(frf["records"]) == 2 * len(frf["hits"])
        assert all(known[r["id"]] == r["sha256"] for r in frf["records"])
    assert result["processing"]["windows"]["force_length_s"] > 0
    engine = make_engine(service.settings.database_url)
    with make_sessions(engine)() as session:
        (measured,) = load_measured_campaign(session, UUID(campaign)).frf_sets
    engine.dispose()
    assert measured.frfs.growth is not None
    assert (
        measured.frfs.variance is not None
    )  # both are what scatter makes of hits of a linear body
    times = np.mean(np.abs(measured.frfs.growth) ** 2) / np.mean(measured.frfs.variance)
    assert 0.3 < times < 2


@pytest.mark.parametrize(("count", "shown"), [(6, True), (3, False)])
def test_frfs_say_how_well_the_window_is_known_that_their_hits_showed(
    api: httpx.Client, campaign: str, count: int, shown: bool
) -> None:
    rng = np.random.default_rng(4)
    body = random_body(rng, "free")
    bench = Bench(
        body, random_laboratory(rng, 1.0), (0.96 * body.length_m, 0.45 * body.width_m), rng
    )
    made = [bench.hit(1, (0.7 * body.length_m, 0.3 * body.width_m), n) for n in range(1, count + 1)]
    ok(post(api, campaign, npz(made)), 201)  # the mapping states no window
    assert processed(api, campaign, {"windows": {}})["status"] == "succeeded"
    (frf,) = ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]
    if shown:
        assert frf["window_rate_per_s"] == pytest.approx(1.0, abs=0.02)
        assert 0 < frf["window_rate_sd_per_s"] < 0.05
    else:
        assert (frf["window_rate_per_s"], frf["window_rate_sd_per_s"]) == (None, None)


def test_the_figure_of_a_point_shows_every_hit_and_what_is_wrong_with_it(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    assert "no time blocks" in ok(api.get(f"campaigns/{campaign}/figures/hits"), 404)["detail"]
    ok(post(api, campaign, npz(hits)), 201)
    wrong = next(s for s in hits if s.fault not in (None, "off_place"))
    point = wrong.hit.force.dof.point
    mine = [s for s in hits if s.hit.force.dof.point == point]
    answer = api.get(f"campaigns/{campaign}/figures/hits", params={"point": point})
    figure = ok(answer, 200)
    panels = [t for t in figure["data"] if t["yaxis"] == "y2"]  # the responses, one a hit
    good = [t for t in panels if t["legendgroup"] == "good"]
    bad = {
        t["legendgroup"]: t
        for t in figure["data"]
        if t.get("legendgroup", "good") != "good" and t["name"]
    }
    assert len(panels) == len(mine)
    assert f"hit {wrong.hit.number}" in bad
    assert bad[f"hit {wrong.hit.number}"]["name"].startswith(f"hit {wrong.hit.number}: ")
    assert len(good) + len(bad) == len(mine)
    forces = [t for t in figure["data"] if t["yaxis"] == "y"]
    drawn = [max(t["y"]) for t in forces]
    np.testing.assert_allclose(drawn, [s.hit.force.samples.max() for s in mine], rtol=1e-4)
    frfs = [t for t in figure["data"] if t["yaxis"] == "y3"]
    first = mine[0].hit
    # away from the windows' edges an FRF of one hit is the quotient of its spectra
    line = len(frfs[0]["x"]) // 5
    lines = np.fft.rfftfreq(first.samples, 1 / first.sample_rate_hz)
    quotient = np.abs(np.fft.rfft(first.responses[0].samples) / np.fft.rfft(first.force.samples))
    if mine[0].fault is None:
        assert frfs[0]["y"][line] == pytest.approx(
            quotient[np.abs(lines - frfs[0]["x"][line]).argmin()], rel=0.2
        )
    unchanged = {"If-None-Match": answer.headers["etag"]}
    again = api.get(
        f"campaigns/{campaign}/figures/hits", params={"point": point}, headers=unchanged
    )
    assert again.status_code == 304
    assert api.get(
        f"campaigns/{campaign}/figures/hits", params={"format": "pdf"}
    ).content.startswith(b"%PDF")
    refused = ok(api.get(f"campaigns/{campaign}/figures/hits", params={"point": 77}), 404)
    assert "there are hits at 1+z" in refused["detail"]
    refused = ok(api.get(f"campaigns/{campaign}/figures/hits", params={"response": 77}), 404)
    assert "there are 99" in refused["detail"]
    # A processing that overrules a judgement is what the figure shows from then on.
    decision = {"point": point, "hit": wrong.hit.number, "use": True}
    assert processed(api, campaign, {"overrules": [decision]})["status"] == "succeeded"
    figure = ok(api.get(f"campaigns/{campaign}/figures/hits", params={"point": point}), 200)
    assert f"hit {wrong.hit.number}" not in {t.get("legendgroup") for t in figure["data"]}


def test_a_script_beside_the_hammer_knows_after_each_hit(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    mapping = {k: v for k, v in MAPPING.items() if k != "hit"}
    answers = []
    for one in hits[:4]:
        sent = {name: values.tolist() for name, values in arrays([one]).items() if name != "hit"}
        body = {"variables": sent, "mapping": mapping}
        answers.append(ok(api.post(f"campaigns/{campaign}/records", json=body), 201))
    assert [[h["hit"] for h in a["hits"]] for a in answers] == [
        [1],
        [1, 2],
        [1, 2, 3],
        [1, 2, 3, 4],
    ]
    last = {h["hit"]: h for h in answers[-1]["hits"]}
    for one in hits[:4]:
        if one.fault != "off_place":
            assert last[one.hit.number]["accepted"] is (one.fault is None)
    assert all(f["sentence"] for h in last.values() for f in h["findings"])


def test_an_accelerometer_that_roves_gives_an_frf_for_each_place(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    """By reciprocity the hits of a hammer that roves are those of a sensor that does: all at one
    place, counted on.
    """
    force, response = MAPPING["channels"]
    swapped = [{**force, "point": 99}, {**response, "point": {"variable": "point"}}]
    mapping = {"sample_rate_hz": {"variable": "fs"}, "channels": swapped}
    answer = ok(post(api, campaign, npz(hits), mapping=json.dumps(mapping)), 201)
    rounded = {
        **mapping,
        "sample_rate_hz": hits[0].hit.sample_rate_hz * (1 + 1e-6),
    }  # as a time column's digits leave it
    first = ok(post(api, campaign, npz(hits[:4]), mapping=json.dumps(rounded)), 201)
    done = processed(api, campaign, {})
    assert done["status"] == "succeeded", done
    frfs = {frf["response_point"]: frf for frf in done["result"]["frfs"]}
    assert len(frfs) == len(done["result"]["frfs"]) == len({s.hit.force.dof.point for s in hits})
    sensor = {
        r["id"]: r["point"]
        for a in (answer, first)
        for r in a["items"]
        if r["quantity"] == "acceleration"
    }
    for point, frf in frfs.items():
        assert frf["reference_point"] == 99
        assert {sensor[r["id"]] for r in frf["records"] if r["id"] in sensor} == {point}
    rows = ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]
    assert [row["has_coherence"] for row in rows] == [True] * len(frfs)
    # of each place by itself, whoever roves
    separate = inspect(by_point([s.hit for s in hits])).coherence
    for place, at in ((answer, hits[-1]), (first, hits[0])):  # that of the place which was hit last
        assert place["coherence"] == {"99": pytest.approx(separate[at.hit.force.dof], rel=0.05)}


def test_a_sensor_that_was_added_between_two_sessions_has_frfs_of_its_own(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    file = io.BytesIO()
    np.savez(
        file,
        **{k: v for k, v in arrays(hits).items() if k != "hit"},
        second=-arrays(hits)["acceleration"],
    )
    counted = {k: v for k, v in MAPPING.items() if k != "hit"}
    both = {
        **counted,
        "channels": [
            *counted["channels"],
            {**counted["channels"][1], "variable": "second", "point": 98},
        ],
    }
    ok(post(api, campaign, npz(hits), mapping=json.dumps(counted)), 201)
    ok(post(api, campaign, file.getvalue(), mapping=json.dumps(both)), 201)
    done = processed(api, campaign, {})
    assert done["status"] == "succeeded", done
    points = sorted({s.hit.force.dof.point for s in hits})
    pairs = [(frf["reference_point"], frf["response_point"]) for frf in done["result"]["frfs"]]
    assert sorted(pairs) == sorted([(p, 99) for p in points] * 2 + [(p, 98) for p in points])


def test_a_user_overrules_and_the_document_says_so(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    ok(post(api, campaign, npz(hits)), 201)
    good = next(s for s in hits if s.fault is None)
    point, number = good.hit.force.dof.point, good.hit.number
    body = {"overrules": [{"point": point, "hit": number, "use": False}]}
    result = processed(api, campaign, body)["result"]
    hit = next(h for h in result["hits"] if (h["point"], h["hit"]) == (point, number))
    assert (hit["accepted"], hit["overruled"]) == (False, False)

    # A decision that means no hit, or two decisions about one hit, are refused before anything is
    # queued.
    decision = body["overrules"][0]
    for wrong, text in (
        (
            [{**decision, "point": 99}],
            f"means hit {number} of point 99, which does not exist; there are point 1, direction 3",
        ),
        ([{**decision, "hit": 99}], f"means hit 99 of point {point}"),
        ([{**decision, "direction": -3}], "in direction -3, which does not exist"),
        ([decision, {**decision, "direction": 3, "use": True}], "contradicts another about"),
    ):
        refused = ok(api.post(f"campaigns/{campaign}/processings", json={"overrules": wrong}), 422)
        assert text in refused["detail"], refused
        assert refused["errors"][0]["pointer"] == f"/overrules/{len(wrong) - 1}"


def test_an_upload_shows_who_decided_what_of_its_hits(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    point = next(s.hit.force.dof.point for s in hits if s.fault is None)
    sent = ok(post(api, campaign, npz([s for s in hits if s.hit.force.dof.point == point])), 201)
    url = f"imports/{ok(api.get(f'campaigns/{campaign}/imports'), 200)['items'][0]['id']}/records"
    assert {hit["decision"] for hit in sent["hits"]} == {None}
    named = {"point": point, "hit": next(hit["hit"] for hit in sent["hits"] if hit["accepted"])}
    decisions = f"campaigns/{campaign}/hit-decisions"
    decision = ok(
        api.post(decisions, json={**named, "good": False, "why": "a cable was touched"}), 201
    )
    before = {hit["hit"]: hit for hit in sent["hits"]}
    after = {hit["hit"]: hit for hit in ok(api.get(url), 200)["hits"]}
    overruled = {
        **before[named["hit"]],
        "accepted": False,
        "overruled": False,
        "decision": decision,
    }
    assert after == {**before, named["hit"]: overruled}
    ok(api.post(decisions, json={**named, "good": None, "why": "it was another's"}), 201)
    assert {hit["hit"]: hit for hit in ok(api.get(url), 200)["hits"]} == before


def test_a_decision_by_hand_is_kept_with_who_and_when_and_later_processings_keep_to_it(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    stored = ok(post(api, campaign, npz(hits)), 201)["items"]
    good = next(s for s in hits if s.fault is None)
    point, number = good.hit.force.dof.point, good.hit.number
    url, named = f"campaigns/{campaign}/hit-decisions", {"point": point, "hit": number}

    def used() -> tuple[bool, bool | None]:
        result = processed(api, campaign, {})["result"]
        hit = next(h for h in result["hits"] if (h["point"], h["hit"]) == (point, number))
        return hit["accepted"], hit["overruled"]

    decision = ok(api.post(url, json={**named, "good": False, "why": "a cable was touched"}), 201)
    assert (decision["direction"], decision["good"], decision["why"]) == (
        3,
        False,
        "a cable was touched",
    )
    assert decision["by"]
    assert decision["created_at"] > stored[-1]["created_at"]
    assert used() == (False, False)
    # What one processing states goes before it.
    overruled = processed(api, campaign, {"overrules": [{**named, "use": True}]})["result"]["hits"]
    assert next(h for h in overruled if (h["point"], h["hit"]) == (point, number))["accepted"]

    back = ok(api.post(url, json={**named, "good": None, "why": "the cable was another's"}), 201)
    assert used() == (True, None)
    assert [one["id"] for one in ok(api.get(url), 200)["items"]] == [back["id"], decision["id"]]

    # A hit that is measured anew under its number is judged anew.
    ok(api.post(url, json={**named, "good": False, "why": "once more"}), 201)
    for block in stored:
        if (block["force_point"], block["hit"]) == (point, number):
            ok(api.delete(f"records/{block['id']}"), 204)
    ok(post(api, campaign, npz([good])), 201)
    assert used() == (True, None)

    for wrong, text in (
        (
            {"point": 99},
            f"means hit {number} of point 99, which does not exist; there are no hits at all",
        ),
        (
            {"direction": -3},
            "in direction -3, which does not exist; there are point 1, direction 3",
        ),
        ({"why": ""}, "at least 1 character"),
    ):
        refused = ok(api.post(url, json={**named, "good": True, "why": "y", **wrong}), 422)
        assert text in str(refused), refused


def test_a_mat_file_and_a_dry_run(api: httpx.Client, campaign: str, hits: list[Simulated]) -> None:
    file = io.BytesIO()
    savemat(file, arrays(hits[:3]))
    proposal = ok(post(api, campaign, file.getvalue(), "hits.mat", dry_run=True), 200)
    assert proposal["blocks"] == 6
    assert proposal["mapping"]["sample_rate_hz"] == {"variable": "fs"}
    assert ok(api.get(f"campaigns/{campaign}/records"), 200)["items"] == []
    assert len(ok(post(api, campaign, file.getvalue(), "hits.mat"), 201)["items"]) == 6


def test_the_same_hit_twice_is_a_conflict_and_stores_nothing(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    ok(post(api, campaign, npz(hits[:2])), 201)
    assert "in the campaign already" in ok(post(api, campaign, npz(hits[1:4])), 409)["detail"]
    assert len(ok(api.get(f"campaigns/{campaign}/records"), 200)["items"]) == 4


def test_the_rest_of_a_hit_whose_force_is_deleted_is_left_out(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    rows = ok(post(api, campaign, npz(hits[:3])), 201)["items"]
    force = next(r for r in rows if r["quantity"] == "force")
    assert api.delete(f"records/{force['id']}").status_code == 204
    ok(api.get(f"records/{force['id']}"), 404)
    later = ok(post(api, campaign, npz(hits[3:4])), 201)  # it does not keep later hits out
    assert later["incomplete"] == [
        f"hit {force['hit']} of point {force['force_point']} has no force"
    ]
    assert len(later["hits"]) == 3
    done = processed(api, campaign, {})
    assert done["status"] == "succeeded", done
    assert (
        f"hit {force['hit']} of point {force['point']} has no force; it was left out"
        in done["result"]["warnings"]
    )
    assert (force["point"], force["hit"]) not in {
        (h["point"], h["hit"]) for h in done["result"]["hits"]
    }


def test_a_uff_file_of_time_blocks_becomes_records(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    def block(samples: np.ndarray[Any, Any], kind: int, unit: str, point: int, force: int) -> bytes:
        rows = [
            "".join(f"{v:20.12e}" for v in samples[i : i + 4]) for i in range(0, samples.size, 4)
        ]
        header = {
            "kind": 4,
            "points": samples.size,
            "function": 1,
            "step": f"{1 / hits[0].hit.sample_rate_hz:13.5e}",
        }
        place = {"response": (point, 3), "reference": (force, 3)}
        return set_58(*rows, abscissa=axis(17, "s"), ordinate=axis(kind, unit), **header, **place)

    data = b""
    for one in hits[:2]:
        at = one.hit.force.dof.point
        data += block(one.hit.force.samples, 13, "N", at, at) + block(
            one.hit.responses[0].samples, 12, "m/s2", 99, at
        )
    lonely = block(hits[2].hit.responses[0].samples, 12, "m/s2", 99, hits[2].hit.force.dof.point)
    sent = api.post(f"campaigns/{campaign}/imports", files={"file": ("hits.uff", data + lonely)})
    job = ok(sent, 202)["id"]

    def ended() -> dict[str, Any] | None:
        row: dict[str, Any] = ok(api.get(f"imports/{job}"), 200)
        return row if row["status"] not in ("queued", "running") else None

    done = until(ended, "the import")
    assert done["counts"] == {
        "frfs": 0,
        "grid_points": 0,
        "modes": 0,
        "records": 4,
        "recordings": 0,
    }
    assert [d["outcome"] for d in done["datasets"]] == ["read"] * 4 + ["ignored"]
    assert "has no force block" in done["datasets"][4]["reason"]
    rows = ok(api.get(f"campaigns/{campaign}/records"), 200)["items"]
    assert [(r["quantity"], r["point"], r["force_point"], r["hit"]) for r in rows] == [
        row
        for s in hits[:2]
        for at, number in [(s.hit.force.dof.point, s.hit.number)]
        for row in (("force", at, at, number), ("acceleration", 99, at, number))
    ]
    samples = ok(api.get(f"records/{rows[1]['id']}/data"), 200)["samples"]
    np.testing.assert_allclose(samples, hits[0].hit.responses[0].samples, rtol=1e-11, atol=1e-12)


def test_what_cannot_be_right_is_refused_with_its_place(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    lame = {**MAPPING, "sample_rate_hz": {"variable": "rate"}}
    problem = ok(post(api, campaign, npz(hits[:1]), mapping=json.dumps(lame)), 422)
    assert "is not in the file" in json.dumps(problem)
    (fault,) = ok(post(api, campaign, npz(hits[:1]), mapping="{force"), 422)["errors"]
    assert (fault["pointer"], fault["detail"].split(":")[0]) == ("mapping", "is not JSON")
    ok(post(api, campaign, b"no archive"), 422)
    assert "the body is empty" in ok(post(api, campaign, b""), 422)["detail"]
    unmapped = api.post(
        f"campaigns/{campaign}/records", content=npz(hits[:1]), params={"filename": "hits.npz"}
    )
    assert "dry_run=true proposes one" in ok(unmapped, 422)["detail"]
    ok(post(api, campaign, npz(hits[:1]), "hits.tdms"), 422)
    ok(api.post(f"campaigns/{campaign}/processings", json={"estimator": "H9"}), 422)
    stranger = f"campaigns/{uuid4()}/records"
    ok(api.get(stranger), 404)
