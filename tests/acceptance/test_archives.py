"""Archives as others meet them: read with pandas and pyuff alone, brought into another service,
damaged in every way.
"""

import io
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path
from typing import Any
from uuid import uuid4
from zipfile import ZIP_DEFLATED, ZipFile

import httpx
import psycopg
import pytest

import modalbase
from modalbase.client.errors import ClientError
from modalbase.objects.archive_file import ArchiveFile
from service.app.supervisor import LocalService
from service.pages.example import paper
from service.platform.db.engine import psycopg_url
from tests.integration.test_coupons import COUPON, CURVE, machine_file
from tests.support.command import modalbase_here
from tests.support.furnished import MODES, MONITOR, frfs, record
from tests.support.rest import client_of, ok

ONE_AFTER_THE_OTHER = """
import runpy, sys
_, script, *words = sys.argv
for file, folder in zip(words[::2], words[1::2]):
    sys.argv = [script, file, folder]
    runpy.run_path(script)
"""
SCRIPT = """
import json, sys, zipfile
from hashlib import sha256
from pathlib import Path
import numpy as np
import pandas as pd
import pyuff

with zipfile.ZipFile(sys.argv[1]) as archive:
    archive.extractall(sys.argv[2])
folder = Path(sys.argv[2])
files = json.loads((folder / "manifest.json").read_text())["files"]
assert all(sha256((folder / name).read_bytes()).hexdigest() == entry["sha256"] for name, entry in files.items())
crate = {one["@id"]: one for one in json.loads((folder / "ro-crate-metadata.json").read_text())["@graph"]}
assert crate["ro-crate-metadata.json"]["about"] == {"@id": "./"} and crate["./"]["@type"] == "Dataset"
assert all(crate[name]["sha256"] == entry["sha256"] for name, entry in files.items() if name[:8] != "ro-crate")
(campaign,) = (folder / "campaigns").iterdir()
rows = pd.read_csv(campaign / "frfs.csv")
sets = [one for one in pyuff.UFF(str(campaign / "frfs.uff")).read_sets() if one["type"] == 58 and one["func_type"] == 4]
assert len(sets) == len(rows)
assert [one["rsp_node"] for one in sets] == rows["response_point"].tolist()
results = pd.read_csv(folder / "results.csv")
modes = pd.read_csv(campaign / "modes.csv")
hits = pd.read_csv(campaign / "hits.csv")
force = hits[hits["quantity"] == "force"].iloc[0]
samples = np.load(campaign / force["file"])[force["variable"]][force["row"]]
(structure,) = (folder / "structures").iterdir()
coupons = pd.read_csv(structure / "coupons.csv")
(curve,) = (structure / "curves").glob("*/curve.csv")
(monitor,) = (structure / "monitors").iterdir()
print(json.dumps({
    "frfs": len(rows), "first": [sets[0]["data"][1].real, sets[0]["data"][1].imag], "Ex": results["Ex"].tolist(),
    "verdict": results["verdict"].tolist(), "f": modes["frequency_hz"].tolist(),
    "points": len(pd.read_csv(campaign / "grid-points.csv")),
    "hits": len(hits), "samples": samples[:3].tolist(), "E": coupons["E_Pa"].tolist()[1:], "curve": len(pd.read_csv(curve)),
    "monitor": json.loads(monitor.read_text())["series"]["state"],
    "instruments": [one["serial"] for one in json.loads((folder / "instruments.json").read_text())],
}))
"""
RESULT = {
    "verdict": {"level": "usable", "sentence": "", "reasons": []},
    "parameters": [
        {
            "name": "Ex",
            "estimate": 3.1e10,
            "standard_deviation": 2e8,
            "interval_95": [3.06e10, 3.14e10],
        }
    ],
    "version": 3,
}


SENSOR = {
    "kind": "sensor",
    "serial": "30517",
    "model": "4507",
    "calibrations": [{"performed_on": "2026-01-15"}],
}


def kept(api: httpx.Client, structure: str, campaign: str) -> None:
    """Hits of three kinds of channels with a decision, two coupons, and a monitor whose prior is
    their batch's.
    """
    for hit, full in ((1, None), (3, None), (4, 200.0)):
        sent = record(hit)
        sent["mapping"]["channels"][0] |= {"sensitivity": 0.5, "full_scale": full}
        ok(api.post(f"campaigns/{campaign}/records", json=sent), 201)
    body = {"point": 1, "hit": 3, "good": False, "why": "a cable was touched"}
    ok(api.post(f"campaigns/{campaign}/hit-decisions", json=body), 201)
    batch = ok(
        api.post(
            f"structures/{structure}/coupon-batches",
            json={"name": "0°", "constants": ["Ex", "nu_xy"]},
        ),
        201,
    )
    path, file = f"coupon-batches/{batch['id']}/coupons", {"file": ("A1.csv", machine_file(CURVE))}
    curve = ok(api.post(path, files=file, data={"coupon": json.dumps(COUPON)}), 201)["items"][0]
    exclusion = {"excluded": True, "exclusion_reason": "slipped"}
    headers = {"If-Match": api.get(f"coupons/{curve['id']}").headers["ETag"]}
    ok(api.patch(f"coupons/{curve['id']}", json=exclusion, headers=headers), 200)
    ok(
        api.post(
            path, json=[{"specimen": s, "E_Pa": E} for s, E in (("A2", 3.1e10), ("A3", 3.2e10))]
        ),
        201,
    )
    recipe = {**MONITOR["recipe"], "prior_from_coupon_batch": batch["id"]}
    ok(api.post(f"structures/{structure}/monitors", json={**MONITOR, "recipe": recipe}), 201)


@pytest.fixture(scope="module")
def api(service: LocalService) -> Iterator[httpx.Client]:
    """A client of one user for all tests here."""
    with client_of(service, f"archives {uuid4()}") as client:
        yield client


@pytest.fixture(scope="module")
def measured(api: httpx.Client, service: LocalService) -> dict[str, str]:
    """A campaign with labels, points, FRFs, modes and a result, which the tests only read."""
    project = ok(api.post("projects", json={"name": "tests"}), 201)["id"]
    body = {**paper.STRUCTURE, "name": "bar", "tags": ["pultruded"]}
    structure = ok(api.post(f"projects/{project}/structures", json=body), 201)["id"]
    for serial in ("30517", "of another test"):
        ok(api.post(f"projects/{project}/instruments", json={**SENSOR, "serial": serial}), 201)
    body = {
        **paper.CAMPAIGN,
        "name": "cold",
        "temperature_c": -3.0,
        "meta": {"client": "ACME"},
        "notes": "œ",
    }
    body["instruments"] = {
        **body.get("instruments", {}),
        "sensor": {"model": "4507", "serial": "30517"},
    }
    campaign = ok(api.post(f"structures/{structure}/campaigns", json=body), 201)["id"]
    points = [{"label": n, "x_m": 0.1 * n, "y_m": 0, "z_m": 0} for n in (1, 2, 11, 12)]
    ok(api.put(f"campaigns/{campaign}/grid-points", json={"items": points}), 200)
    for first in (11, 12):
        ok(api.post(f"campaigns/{campaign}/frfs", json=frfs(first)), 201)
    labels = {"tags": ["second hammer"], "meta": {"tip": "steel"}}
    ok(api.put(f"campaigns/{campaign}/frfs/labels", json=labels, params={"point": 12}), 200)
    ok(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "typed", "modes": MODES}), 201)
    kept(api, structure, campaign)
    job = ok(api.post(f"campaigns/{campaign}/update-jobs", json={}), 202)["id"]
    row = (
        "INSERT INTO update_results (id, campaign_id, document, prediction) VALUES (%s, %s, %s, '')"
    )
    with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
        connection.execute(row, [job, campaign, json.dumps(RESULT)])
    return {"project": project, "structure": structure, "campaign": campaign, "job": job}


def key_of(api: httpx.Client) -> str:
    return api.headers["Authorization"].removeprefix("Bearer ")


def test_others_read_an_archive_with_pandas_and_pyuff(
    service: LocalService, api: httpx.Client, measured: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    with modalbase.connect(service.url, key_of(api)) as lab:
        found = lab.find(
            "campaigns", f"meta.client = 'ACME' AND project.id = '{measured['project']}'"
        )
        files = [
            lab.project(measured["project"]).archive(tmp_path / "project.zip"),
            lab.campaign(measured["campaign"]).archive(tmp_path / "campaign.zip"),
            found.archive(tmp_path / "found.zip"),
        ]
        with pytest.raises(ClientError, match="search for those whose modes"):
            lab.find("modes", "frequency_hz > 0").archive(tmp_path / "modes.zip")
        with pytest.raises(ClientError, match="campaign that the search finds"):
            lab.find("campaigns", "temperature_c > 900").archive(tmp_path / "nothing.zip")
    # one after the other in one process, which imports pandas once
    command = [sys.executable, "-c", ONE_AFTER_THE_OTHER, str(tmp_path / "script.py")]
    command += [word for file in files for word in (str(file), str(tmp_path / file.stem))]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    for file, said in zip(files, done.stdout.splitlines(), strict=True):
        assert json.loads(said) == {
            "frfs": 2, "first": [2.0, 0.5], "Ex": [3.1e10], "verdict": ["usable"], "points": 4,
            "f": [mode["frequency_hz"] for mode in MODES], "hits": 6, "samples": [0.0, 2.0, 1.0],
            "E": [3.1e10, 3.2e10], "curve": len(CURVE), "monitor": "no data",
            "instruments": ["30517", "of another test"] if file.stem == "project" else ["30517"],
        }  # fmt: skip
    document = next((tmp_path / "project").glob("campaigns/*/results/*.json"))
    assert json.loads(document.read_text())["labels"] == {"tags": [], "meta": {}}


@pytest.mark.long
def test_another_service_has_what_was_measured_under_new_ids(
    service: LocalService,
    new_service: Callable[..., LocalService],
    api: httpx.Client,
    measured: dict[str, str],
    tmp_path: Path,
) -> None:
    with modalbase.connect(service.url, key_of(api)) as lab:
        file = lab.project(measured["project"]).archive(tmp_path / "project.zip")
        before = lab.campaign(measured["campaign"])
        spectra = before.frfs()
    with new_service() as other, modalbase.connect(other.url, key := other.new_key("heir")) as lab:
        project = lab.new_project("heirloom")
        done = project.import_archive(file)
        assert (
            len(done.ids) == 2 + 1 + (1 + 3) + 1 + 1 + 6 + 1
        )  # instruments, structure, coupons, monitor, campaign, hits, modes
        assert done.results == [f"campaigns/{measured['campaign']}/results/{measured['job']}.json"]
        structure = lab.structure(done.ids[measured["structure"]])
        assert (structure.name, structure.tags, structure.meta["archive"]["id"]) == (
            "bar", ["pultruded"], measured["structure"],
        )  # fmt: skip
        campaign = lab.campaign(done.ids[measured["campaign"]])
        assert campaign.fields["structure_id"] == structure.id
        for name in (
            "name",
            "boundary",
            "temperature_c",
            "performed_at",
            "instruments",
            "frame",
            "inputs",
            "notes",
        ):
            assert campaign.fields[name] == before.fields[name], name
        assert campaign.meta == {"client": "ACME", "archive": campaign.meta["archive"]}
        assert (campaign.frfs().values == spectra.values).all()
        labelled = list(lab.find("frfs", "tag = 'second hammer' AND meta.tip = 'steel'"))
        assert [row["response_point"] for row in labelled] == [12]
        found = list(lab.find("campaigns", f"meta.archive.id = '{measured['campaign']}'"))
        assert [row["id"] for row in found] == [campaign.id]
        assert len(list(lab.find("modes", "frequency_hz > 0"))) == len(MODES)
        assert_kept(file, project.archive(tmp_path / "again.zip"), done.ids)
        (decision,) = campaign.hit_decisions()
        assert decision["why"].startswith("a cable was touched (")
        (monitor,) = structure.monitors()
        assert (monitor.active, monitor.runs()[:]) == (False, [])
        with modalbase.connect(service.url, key_of(api)) as before_lab:
            later = before_lab.project(measured["project"]).archive(tmp_path / "later.zip")
        with pytest.raises(ClientError, match=r"the project heirloom .*again=True"):
            lab.new_project("another").import_archive(later)  # written later, of the same content
        again = campaign.archive(tmp_path / "again.zip")
        assert frequencies(again) == frequencies(file)
        older = {"performed_on": "2024-01-15"}
        lab.new_project("by command").add_instrument(
            "sensor", "30517", model="own", calibrations=[older]
        )
        place = {"MODALBASE_URL": other.url, "MODALBASE_API_KEY": key}
        refused = modalbase_here("import-archive", str(file), "by command", **place)
        assert (
            f"the project heirloom ({project.id}) has what is in this archive since 20"
            in refused.stderr
        )
        assert lab.project("by command").structures() == []
        said = modalbase_here("import-archive", str(file), "by command", "--again", **place)
        assert "1 results stay in project.zip" in said.stdout, said.stderr
        (structure,) = lab.project("by command").structures()
        assert f"{measured['structure']} is {structure.id}" in said.stdout
        sensor = lab.project("by command").instruments()["30517"]
        dates = [one["performed_on"] for one in sensor["calibrations"]]
        assert (sensor["model"], dates) == ("own", ["2024-01-15", "2026-01-15"])


ANEW = {
    *(
        "id",
        "batch_id",
        "structure_id",
        "structure_version_id",
        "created_at",
        "updated_at",
        "project_id",
        "campaign_id",
    ),
    *("by", "why", "active", "acts_for", "state_since", "series"),
    "request",  # has the exclusion of later in it
}


def assert_kept(before: Path, after: Path, ids: dict[str, str]) -> None:
    """Hits, decisions, coupons, monitors and instruments of two archives are the same but for ids
    and times.
    """
    import pandas as pd  # takes half a second of each process that looks for tests

    with ZipFile(before) as was, ZipFile(after) as now:
        for end in ("/hits.csv", "/coupons.csv", "/curve.csv", "/original"):
            one, two = (
                file.read(next(n for n in file.namelist() if n.endswith(end)))
                for file in (was, now)
            )
            if end == "/hits.csv":
                tables = [pd.read_csv(io.BytesIO(table)) for table in (one, two)]
                assert [ids[key] for key in tables[0]["id"]] == tables[1]["id"].tolist()
                left, right = (
                    table.drop(columns=["id", "filename", "created_at"]) for table in tables
                )
                # with the SHA-256 of each block's samples
                pd.testing.assert_frame_equal(left, right)
            else:
                assert one == two, end
        for part in (
            "/hit-decisions.json",
            "/coupon-batches.json",
            "/monitors/",
            "instruments.json",
        ):
            one, two = (
                json.loads(file.read(next(n for n in file.namelist() if part in n or n == part)))
                for file in (was, now)
            )
            assert plain(one, ids) == plain(two, {}), part


def plain(value: Any, ids: dict[str, str]) -> Any:
    """A document without what a service gives anew; ids in it as they are now."""
    if isinstance(value, dict):
        return {name: plain(one, ids) for name, one in value.items() if name not in ANEW}
    if isinstance(value, list):
        return [plain(one, ids) for one in value]
    return ids.get(value, value) if isinstance(value, str) else value


def frequencies(path: Path) -> list[float]:
    import pandas as pd

    with ZipFile(path) as archive:
        name = next(name for name in archive.namelist() if name.endswith("/modes.csv"))
        table: list[float] = pd.read_csv(io.BytesIO(archive.read(name)))["frequency_hz"].tolist()
        return table


Members = dict[str, bytes]


def without(members: Members, end: str) -> Members:
    return {name: content for name, content in members.items() if not name.endswith(end)}


def restated(members: Members, **changed: Any) -> Members:
    manifest = json.loads(members["manifest.json"]) | changed
    return members | {"manifest.json": json.dumps(manifest).encode()}


def grown(members: Members) -> Members:
    files = json.loads(members["manifest.json"])["files"] | {
        "a.json": {"bytes": 10**8, "sha256": "0" * 64}
    }
    return restated(members, files=files) | {"a.json": bytes(10**8)}


def elsewhere(members: Members) -> Members:
    return members | {"../../evil": b"x"}


DAMAGES: list[tuple[str, Callable[[Members], Members], str]] = [
    (
        "a member is gone",
        lambda m: without(m, "/frfs.uff"),
        "other members than its manifest: .*frfs.uff",
    ),
    ("a member is added", elsewhere, "other members than its manifest: .*evil"),
    ("the manifest is gone", lambda m: without(m, "manifest.json"), "is no archive of modalbase"),
    (
        "the manifest is no JSON",
        lambda m: m | {"manifest.json": b"{"},
        "is no archive of modalbase",
    ),
    (
        "the manifest is a list",
        lambda m: m | {"manifest.json": b"[]"},
        "is no archive of modalbase",
    ),
    (
        "the manifest's files are none",
        lambda m: restated(m, files={"x": 3}),
        "is no archive of modalbase",
    ),
    ("a later format", lambda m: restated(m, format=2), "of format 2; this version reads 1"),
    ("it would grow", grown, "would grow to .* bytes"),
    (
        "another content",
        lambda m: {name: content.replace(b"cold", b"warm") for name, content in m.items()},
        "campaign.json is not what the manifest says",
    ),
]


def test_a_damaged_archive_is_refused_before_anything_is_sent(
    service: LocalService, api: httpx.Client, measured: dict[str, str], tmp_path: Path
) -> None:
    with modalbase.connect(service.url, key_of(api)) as lab:
        file = lab.project(measured["project"]).archive(tmp_path / "good.zip")
        project = lab.new_project("untouched")
        with ZipFile(file) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        bad = tmp_path / "bad.zip"
        for what, damage, said in DAMAGES:
            with ZipFile(bad, "w", ZIP_DEFLATED) as archive:
                for name, content in damage(members).items():
                    archive.writestr(name, content)
            with pytest.raises(ClientError, match=said):
                project.import_archive(bad)
            assert project.structures() == [], what
        whole = file.read_bytes()
        for cut in range(0, len(whole), len(whole) // 40):
            bad.write_bytes(whole[:cut])
            with pytest.raises(ClientError):
                project.import_archive(bad)
        for place in range(10, len(whole), len(whole) // 60):
            bad.write_bytes(whole[:place] + bytes([whole[place] ^ 0x41]) + whole[place + 1 :])
            refused_or_harmless(bad)
        assert project.structures() == []


def refused_or_harmless(path: Path) -> None:
    """A flipped bit is refused, or lies where a zip says something of itself that nobody reads."""
    try:
        with ArchiveFile(path) as archive:
            archive.check()
    except ClientError:
        return
    with ZipFile(path) as found:
        assert found.testzip() is None


def test_an_archive_that_contradicts_itself_is_refused(
    service: LocalService, api: httpx.Client, measured: dict[str, str], tmp_path: Path
) -> None:
    """Its digests are right; what it says is not: a campaign of a structure of somebody else."""
    with modalbase.connect(service.url, key_of(api)) as lab:
        file = lab.project(measured["project"]).archive(tmp_path / "good.zip")
        with ZipFile(file) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        folder = f"campaigns/{measured['campaign']}"
        campaign = json.loads(members[f"{folder}/campaign.json"])
        foreign = json.dumps(campaign | {"structure_id": measured["job"]}).encode()
        strange = members[f"{folder}/frfs.csv"].replace(b'"[""second hammer""]"', b"[")
        for name, content, said in (
            (f"{folder}/campaign.json", foreign, "a structure that the archive does not have"),
            (f"{folder}/campaign.json", b"[]", "something in the archive|is not as an archive is"),
            (
                f"{folder}/frfs.csv",
                strange,
                "frfs.csv of good.zip is not as an archive is: JSONDecodeError",
            ),
            (f"{folder}/frfs.uff", b"noise", "frfs.uff of good.zip is not as an archive is"),
        ):
            files = json.loads(members["manifest.json"])["files"]
            files[name] = {"bytes": len(content), "sha256": sha256(content).hexdigest()}
            with ZipFile(file, "w", ZIP_DEFLATED) as archive:
                for path, kept in (restated(members, files=files) | {name: content}).items():
                    archive.writestr(path, kept)
            project = lab.new_project(said)
            with pytest.raises(ClientError, match=said):
                project.import_archive(file)
            assert project.structures() == [], "nothing is left by half"
            assert lab.rest.list_structures(project.id, deleted=True)["items"] == [], "nor hidden"
            assert len(project.instruments()) == 0


def test_of_several_that_read_an_archive_at_once_one_does(
    service: LocalService, api: httpx.Client, measured: dict[str, str], tmp_path: Path
) -> None:
    with modalbase.connect(service.url, key_of(api)) as lab:
        file = lab.project(measured["project"]).archive(tmp_path / "once.zip")
        with ZipFile(file) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        folder = f"campaigns/{measured['campaign']}"
        # else it is there already
        content = members[f"{folder}/campaign.json"].replace(b"cold", b"cool")
        files = json.loads(members["manifest.json"])["files"]
        files[f"{folder}/campaign.json"] |= {
            "bytes": len(content),
            "sha256": sha256(content).hexdigest(),
        }
        with ZipFile(file, "w", ZIP_DEFLATED) as archive:
            for path, kept in (
                restated(members, files=files) | {f"{folder}/campaign.json": content}
            ).items():
                archive.writestr(path, kept)
        project = lab.new_project("at once")
        names = {one.name for one in lab.project(measured["project"]).structures()}

    def read(_: int) -> str:
        with modalbase.connect(service.url, key_of(api)) as lab:
            try:
                lab.project(project.id).import_archive(file)
            except ClientError as error:
                return str(error)
        return ""

    with ThreadPoolExecutor(4) as pool:
        came = list(pool.map(read, range(4)))
    assert came.count("") == 1, came
    assert all("being read" in one or "has what is in this archive" in one for one in came if one)
    with modalbase.connect(service.url, key_of(api)) as lab:
        assert {one.name for one in lab.project(project.id).structures()} == names
        assert all(one.version == 1 for one in lab.project(project.id).structures())


def test_an_archive_has_nothing_of_others(
    measured: dict[str, str], new_client: Callable[[], httpx.Client]
) -> None:
    stranger = new_client()
    for path in (
        f"projects/{measured['project']}/archive",
        f"campaigns/{measured['campaign']}/archive",
    ):
        assert stranger.get(path).status_code == 404
    assert stranger.get("search/campaigns/archive").status_code == 404
    own = ok(stranger.post("projects", json={"name": "own"}), 201)["id"]
    with ZipFile(io.BytesIO(stranger.get(f"projects/{own}/archive").content)) as archive:
        has = ["instruments.json", "manifest.json", "results.csv", "ro-crate-metadata.json"]
        assert sorted(archive.namelist()) == has
