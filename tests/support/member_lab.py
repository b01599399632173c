"""A laboratory with two of everything that a list may have and one of all else, whose jobs have
run.
"""

from __future__ import annotations

import io
import json
from datetime import UTC, datetime
from typing import Any
from uuid import UUID, uuid4

import h5py
import httpx
import numpy as np
import scipy
from sqlalchemy import insert, select, update

from examples import monitoring
from examples.monitoring import State, measured_frfs, structure_body
from service.nouns.monitors.runs import newest_series
from service.nouns.monitors.tables import Monitor
from service.platform.db.base import Base
from service.platform.db.engine import Sessions
from tests.support.furnished import frfs, record
from tests.support.members import Lab
from tests.support.profiles import ANGLE
from tests.support.rest import RAW, finished, ok, posted
from tests.support.wind import WIND, wind

ATTACHED = ("project", "structure", "campaign", "update_job", "joint_update", "monitor")


def attachments_of(noun: str) -> str:
    """The address of what is attached to a noun."""
    key = "joint_id" if noun == "joint_update" else f"{noun}_id"
    return f"{noun.replace('_', '-')}s/{{{key}}}/attachments"


MESH = (
    "SOL 103\nCEND\nBEGIN"
    " BULK\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,.2,0.\nGRID,4,,0.,.2,0.\n"
    "CQUAD4,1,1,1,2,3,4\nPSHELL,1,1,.01,1,,1\nMAT1,1,7.+10,,.3,2700.\nENDDATA\n"
)
RECIPE: dict[str, Any] = {
    "identification": {"band_hz": [5, 500], "highest_order": 10},
    "damping_models": ["rayleigh"],
    "parameters": [
        {"name": "Ex"},
        {"name": "Gxy", "tied_to": "Ex"},
        {"name": "Gxz", "tied_to": "Ex"},
    ],
}
OF_GIVEN_MODES = {name: value for name, value in RECIPE.items() if name != "identification"}
JOINT_RECIPE = {name: value for name, value in RECIPE.items() if name != "damping_models"}
MODES = [
    {"frequency_hz": hz, "damping_ratio": ratio}
    for hz, ratio in ((26.16, 0.02), (163.23, 0.015), (453.81, 0.02))
]  # of the beam: what disagrees with it has the job look for an explanation
RAISED = [{**mode, "frequency_hz": 1.01 * mode["frequency_hz"]} for mode in MODES]


def _curve(slope: float) -> str:
    rows = (f"{slope * strain / 1000:.6f},{strain}" for strain in range(0, 12_000, 500))
    return "\n".join(["test {n}", "force,strain", "kN,µm/m", *rows, ""])


CURVE, STIFFER = _curve(0.002), _curve(0.0022)
COUPON: dict[str, Any] = {
    "specimen": "curve {n}",
    "dimensions": {"unit": "mm", "width": [25.0], "thickness": [2.0]},
    "columns": {
        "force": {"header": "force", "unit": "kN"},
        "strain": {"header": "strain", "unit": "µm/m"},
    },
}


DOFS = {
    "response_point": 7,
    "response_direction": 3,
    "reference_point": 1,
    "reference_direction": 3,
}
HERTZ, VALUES = np.array([1.0, 2.0, 3.0]), np.array([1 + 1j, 2 - 1j, 3 + 0.5j])
SAMPLES = np.array([0.0, 1.0, 0.5, 0.1] + 60 * [0.0])
MAPPING: dict[str, Any] = record()["mapping"]


def _table(columns: dict[str, Any]) -> bytes:
    rows = zip(
        *(
            np.broadcast_to(column, np.size(next(iter(columns.values())))).tolist()
            for column in columns.values()
        ),
        strict=True,
    )
    return "\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows), ""]).encode()


def _npz(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _npy(array: np.ndarray[Any, Any]) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _hdf5(**arrays: Any) -> bytes:
    file = io.BytesIO()
    with h5py.File(file, "w") as written:
        for name, array in arrays.items():
            written.create_dataset(name, data=array)
    return file.getvalue()


def _mat(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, arrays)
    return buffer.getvalue()


FRFS_CSV = _table({"frequency_hz": HERTZ, **DOFS, "real": VALUES.real, "imag": VALUES.imag})
FRFS_NPZ = _npz(frequency_hz=HERTZ, values=VALUES[np.newaxis], **DOFS)
FRFS_MAT = _mat(f=HERTZ, H=VALUES)
FRFS_NPY = _npy(VALUES)
FRFS_HDF5 = _hdf5(frequency_hz=HERTZ, values=VALUES[np.newaxis], **DOFS)
MORE_NPZ = _npz(f=2 * SAMPLES, a=SAMPLES[::-1])
LONG = np.random.default_rng(0).standard_normal(8192) * np.exp(-np.arange(8192) / 2000)
# more samples than a figure shows at once
LONG_NPZ = _npz(f=np.where(np.arange(8192) < 5, 1.0, 0.0), a=LONG)
HITS_NPZ, HITS_CSV = _npz(f=SAMPLES, a=SAMPLES[::-1]), _table({"f": SAMPLES, "a": SAMPLES[::-1]})
OF_NPZ = {
    "frequency_hz": {"variable": "frequency_hz"},
    "frf": {"variable": "values"},
    "response_point": 5,
    "reference_point": 6,
}
OF_CSV = {**OF_NPZ, "frf": {"real": "real", "imaginary": "imag"}}
OF_NPY = {
    **OF_NPZ,
    "frequency_hz": {"start": float(HERTZ[0]), "step": float(HERTZ[1] - HERTZ[0])},
    "frf": {"variable": "array"},
}
OF_MAT = {**OF_NPZ, "frequency_hz": {"variable": "f"}, "frf": {"variable": "H"}}


class Furnishing:
    """Makes the things one after the other; jobs are awaited at the end."""

    def __init__(self, api: httpx.Client, chief: httpx.Client, sessions: Sessions) -> None:
        self.api, self.sessions, self.lab = api, sessions, Lab(api, {}, chief)
        self.jobs, self.months = list[str](), dict[UUID, int]()

    def made(self, path: str, body: Any = None, **more: Any) -> Any:
        filled = None if body is None else self.lab.filled(body, {})
        return posted(self.api, self.lab.filled(path, {}), filled, **more)

    def make(self, name: str, path: str, body: Any = None, **more: Any) -> Any:
        """Make something and keep its id."""
        found = self.made(path, body, **more)
        found = found["items"][0] if "items" in found and "id" not in found else found
        self.lab.ids[name] = found["id"]
        if "status" in found:
            self.jobs.append(f"{path.rstrip('s').rsplit('/', 1)[-1]}s/{found['id']}")
        return found

    def cancel(self) -> None:
        """End the newest job, which is there to be listed alone."""
        self.api.post(f"{self.jobs.pop()}/cancel").raise_for_status()

    def copied(self, month: int) -> None:
        """End the newest job, an update, which is to have a result like the first one's."""
        self.months[UUID(self.jobs[-1].rpartition("/")[2])] = month
        self.cancel()

    def ended(self) -> None:
        """Wait for all jobs."""
        for job in self.jobs:
            state = finished(self.api, job)
            assert state["status"] == "succeeded", (job, state)
        self.jobs.clear()

    def structures(self) -> None:
        for name in ("project_id", "second_project_id", "deleted_project_id"):
            self.make(name, "projects", {"name": name})
        for name in ("structure_id", "second_structure_id", "deleted_structure_id"):
            self.make(name, "projects/{project_id}/structures", {**structure_body(), "name": name})
        self.make("angle_id", "projects/{project_id}/structures", ANGLE)
        for name in ("bare_id", "sent_id"):
            self.make(name, "projects/{project_id}/structures", {"name": name})
        for name, number in (("campaign_id", 0), ("second_campaign_id", 1)):
            body = {
                "name": name,
                "boundary": "cantilever",
                "performed_at": f"2024-0{number + 1}-15T10:00:00Z",
            }
            body |= {"temperature_c": 15.0 + 5 * number, "humidity_percent": 40.0 + number}
            self.make(name, "structures/{structure_id}/campaigns", body)
            values = measured_frfs(State(stiffness=1 - 0.01 * number), number)
            monitoring.send_measurement(self.api, self.lab.ids[name], values)
            self.api.post(f"campaigns/{self.lab.ids[name]}/complete").raise_for_status()
        for name in ("hits_id", "deleted_campaign_id", "small_id"):
            self.make(
                name, "structures/{structure_id}/campaigns", {"name": name, "boundary": "free"}
            )
        self.make(
            "long_id", "structures/{structure_id}/campaigns", {"name": "long", "boundary": "free"}
        )
        self.make("long_record_id", "campaigns/{long_id}/records", content=LONG_NPZ, headers=RAW, params={
            "filename": "long.npz", "mapping": json.dumps(MAPPING)})  # fmt: skip
        self.make("deleted_import_id", "campaigns/{deleted_campaign_id}/imports", content=FRFS_CSV,
            headers=RAW, params={"filename": "f.csv", "quantity": "mobility"})  # fmt: skip
        self.make("frf_id", "campaigns/{small_id}/frfs", frfs())
        self.make("second_frf_id", "campaigns/{small_id}/frfs", frfs(2))

    def of_responses(self) -> None:
        """Two recordings, whose spectra a processing makes."""
        self.make(
            "wind_id", "structures/{structure_id}/campaigns", {"name": "wind", "boundary": "free"}
        )
        for seed in (1, 2):
            self.make("wind_import_id", "campaigns/{wind_id}/imports", content=wind(seed), headers=RAW, params={
                "filename": f"wind {seed}.npz", "mapping": json.dumps(WIND)})  # fmt: skip
        self.ended()
        self.lab.ids["recording_id"] = ok(
            self.api.get(f"campaigns/{self.lab.ids['wind_id']}/recordings")
        )["items"][0]["id"]
        self.make("wind_processing_id", "campaigns/{wind_id}/processings", {})

    def of_campaigns(self) -> None:
        self.lab.ids["measured_frf_id"] = ok(
            self.api.get(f"campaigns/{self.lab.ids['campaign_id']}/frfs")
        )["items"][0]["id"]
        for hit in (1, 2, 3):
            self.make("record_id", "campaigns/{hits_id}/records", record(hit))
        for name in ("second_mode_set_id", "mode_set_id"):
            self.make(
                name,
                "campaigns/{campaign_id}/mode-sets",
                {"name": name, "modes": MODES if name == "mode_set_id" else RAISED},
            )
        for hit in (1, 2):
            self.made(
                "campaigns/{hits_id}/hit-decisions",
                {"point": 1, "hit": hit, "good": True, "why": "short"},
            )
        for name, frf in (("second_import_id", "second_frf_id"), ("import_id", "frf_id")):
            sent = self.api.get(
                f"frfs/{self.lab.ids[frf]}/data", params={"format": "uff-ascii"}
            ).content
            self.make(
                name,
                "campaigns/{small_id}/imports",
                content=sent,
                headers=RAW,
                params={"filename": f"{name}.uff"},
            )
        for name in ("second_processing_id", "processing_id"):
            self.make(name, "campaigns/{hits_id}/processings", {})
        for name in ("second_identification_id", "identification_id"):
            self.make(
                name,
                "campaigns/{campaign_id}/identifications",
                {"band_hz": [5, 500], "highest_order": 10},
            )
        self.make(
            "other_identification_id",
            "campaigns/{second_campaign_id}/identifications",
            {"band_hz": [5, 500]},
        )

    def of_structures(self) -> None:
        for name in ("second_batch_id", "batch_id"):
            body = {
                "name": name,
                "constants": ["Ex"],
                "published": {"Ex": {"mean": 33e9, "standard_deviation": 1e9, "n": 5}},
            }
            self.make(name, "structures/{structure_id}/coupon-batches", body)
        self.make(
            "coupon_id", "coupon-batches/{batch_id}/coupons", {"specimen": "first", "E_Pa": 3.3e10}
        )
        self.make("curve_id", "coupon-batches/{batch_id}/coupons", files={"file": ("c.csv", CURVE)}, data={
            "coupon": json.dumps(self.lab.filled(COUPON, {}))})  # fmt: skip
        for name in ("second_forecast_id", "forecast_id"):
            self.make(
                name,
                "structures/{structure_id}/forecasts",
                {"modes": 3, "damping_ratio": 0.01, "line_spacing_hz": 5},
            )
            if name == "second_forecast_id":
                self.cancel()
        for name in ("second_model_id", "model_id"):
            sent = MESH.replace("7.+10", "7.1+10") if name == "model_id" else MESH
            self.make(name, "structures/{bare_id}/model", content=sent.encode(), headers=RAW, params={
                "filename": "m.bdf", "units": "m-N-kg"})  # fmt: skip
        for name in ("instrument_id", "second_instrument_id", "deleted_instrument_id"):
            self.make(name, "projects/{project_id}/instruments", {"kind": "sensor", "serial": name})

    def updates(self) -> None:
        """Of the first campaign's FRFs, and of its typed modes and the last one's together; the others
        have results that are like the first.
        """
        self.make("job_id", "campaigns/{campaign_id}/update-jobs", RECIPE)
        typed = {**OF_GIVEN_MODES, "mode_set": "{later_set_id}"}
        self.make("second_job_id", "campaigns/{second_campaign_id}/update-jobs", RECIPE)
        self.copied(1)
        for month in (3, 4, 5):  # so that a trend has a line beside a covariate
            body = {
                "name": f"month {month}",
                "boundary": "cantilever",
                "performed_at": f"2024-0{month}-15T10:00:00Z",
            }
            body |= {"temperature_c": 15.0 + month**2 % 7, "humidity_percent": 40.0 + month**3 % 11}
            self.make("later_id", "structures/{structure_id}/campaigns", body)
            modes = [
                {**mode, "frequency_hz": (1 - month / 1000) * mode["frequency_hz"]}
                for mode in MODES
            ]
            self.make(
                "later_set_id", "campaigns/{later_id}/mode-sets", {"name": "typed", "modes": modes}
            )
            self.make("later_job_id", "campaigns/{later_id}/update-jobs", typed)
            self.copied(month)
        both = (("campaign_id", "mode_set_id"), ("later_id", "later_set_id"))
        joint = {
            "recipe": {"parameters": [{"name": "Ex"}]},
            "joint": True,
            "jobs": [
                {"campaign_id": f"{{{campaign}}}", "recipe": {"mode_set": f"{{{modes}}}"}}
                for campaign, modes in both
            ],
        }
        for name in ("joint_id", "second_joint_id"):
            self.lab.ids[name] = self.made("update-jobs", joint)["joint"]["id"]
            self.jobs.append(f"joint-updates/{self.lab.ids[name]}")
        self.cancel()
        watch = {
            "recipe": RECIPE,
            "modes": "given",  # so that a run identifies nothing
            "parameters": [{"name": "Ex"}, {"name": "a0"}],
            "baseline": {"campaigns": 4},
            "runs_on": "hand",
        }
        for name in ("monitor_id", "second_monitor_id", "deleted_monitor_id"):
            self.make(name, "structures/{structure_id}/monitors", {**watch, "name": name})

    def of_projects(self) -> None:
        for name in ("webhook_id", "second_webhook_id"):
            self.make(name, "webhooks", {"project": "{project_id}", "url": "{hook}"})
            self.made("webhooks/{webhook_id}/test")
        for name in ("search_id", "second_search_id"):
            self.make(name, "searches", {"project": "{project_id}", "name": name, "noun": "frfs"})
        for name in ("key_id", "second_key_id"):
            self.make(name, "api-keys", {"name": name, "scopes": ["read"]})
        ids = {name: UUID(self.lab.ids[f"{name}_id"]) for name in ("project", "monitor", "webhook")}
        row = {f"{name}_id": key for name, key in ids.items()} | {
            "event": "alarm.raised",
            "body": "{}",
            "channel": "webhook",
            "state": "failed",
        }
        with self.sessions.begin() as session:  # that a monitor sends takes many campaigns
            table = Base.metadata.tables["deliveries"]
            for number, name in enumerate(("second_delivery_id", "delivery_id")):
                sent = (
                    insert(table).values({**row, "message_id": str(number)}).returning(table.c.id)
                )
                self.lab.ids[name] = str(session.execute(sent).scalar_one())
        self.lab.alarm = self.alarm
        self.lab.ids |= {"alarm_id": self.alarm(), "second_alarm_id": self.alarm("cleared")}

    def attachments(self) -> None:
        """Two beside each noun that may have some."""
        for name in ("", "second_"):
            self.lab.ids[f"{name}update_job_id"] = self.lab.ids[f"{name}job_id"]
        for noun in ATTACHED:
            for name in ("a.txt", "b.txt"):
                path = attachments_of(noun)
                sent = {"content": name.encode(), "headers": RAW, "params": {"filename": name}}
                self.make("attachment_id", path, **sent)

    def alarm(self, state: str = "alarm") -> str:
        """An alarm of the monitor, which otherwise takes many campaigns; a parameter has one that
        is open.
        """
        table = Base.metadata.tables["alarms"]
        row = {
            "monitor_id": UUID(self.lab.ids["monitor_id"]),
            "campaign_id": UUID(self.lab.ids["campaign_id"]),
        }
        row |= {"series": 1, "parameter": f"Ex{uuid4().hex}", "state": state}
        row |= {"details": {"performed_at": "2026-03-02T09:30:00+00:00", "value": 3e10}}
        with self.sessions.begin() as session:
            return str(
                session.execute(insert(table).values(row).returning(table.c.id)).scalar_one()
            )

    def of_jobs(self) -> None:
        """What only the results have: mode sets that were identified, and the numbers of the jobs'
        last events.
        """
        for name, job in (
            ("identified_id", "identification_id"),
            ("other_identified_id", "other_identification_id"),
        ):
            campaign = self.lab.ids[
                "campaign_id" if name == "identified_id" else "second_campaign_id"
            ]
            sets = ok(self.api.get(f"campaigns/{campaign}/mode-sets"))["items"]
            (self.lab.ids[name],) = (one["id"] for one in sets if self.lab.ids[job] in str(one))
        for name in ("update-jobs/{job_id}", "joint-updates/{joint_id}"):
            stream = self.api.get(self.lab.filled(f"{name}/events", {})).text
            number = next(line for line in stream.splitlines() if line.startswith("id:"))
            self.lab.ids[f"{name.split('-')[0]}_event"] = number.removeprefix("id:").strip()

    def results(self) -> None:
        """Results of the updates that were not run: the first one's, softer by 0.1 % a month."""
        table, jobs = (Base.metadata.tables[name] for name in ("update_results", "update_jobs"))
        with self.sessions.begin() as session:
            first = select(table).where(table.c.id == UUID(self.lab.ids["job_id"]))
            row = session.execute(first).mappings().one()
            for job, month in self.months.items():
                found = select(jobs.c.campaign_id).where(jobs.c.id == job)
                parameters = [
                    {**one, "comparable": None, "estimate": one["estimate"] * (1 - month / 1000)}
                    for one in row["document"]["parameters"]
                ]
                own = {"id": job, "campaign_id": session.execute(found).scalar_one()}
                own |= {"document": row["document"] | {"parameters": parameters}}
                session.execute(insert(table).values({**row, **own}))

    def series(self) -> None:
        """A judged series of the monitor, which otherwise takes many campaigns."""
        monitor = UUID(self.lab.ids["monitor_id"])
        campaigns = [UUID(self.lab.ids[f"{name}campaign_id"]) for name in ("", "second_")]
        parameter = {
            "name": "Ex",
            "state": "no data",
            "baseline": None,
            "timeline": [],
            "notes": [],
        }
        document = {"state": "no data", "notes": [], "parameters": [parameter]}
        tables = Base.metadata.tables
        with self.sessions.begin() as session:
            newest_series(session, session.get_one(Monitor, monitor))
            own = tables["monitor_series"].c.monitor_id == monitor
            judged = update(tables["monitor_series"]).where(own).values(document=document)
            key = session.execute(judged.returning(tables["monitor_series"].c.id)).scalar_one()
            for day, campaign in enumerate(campaigns, 1):
                at = datetime(2026, 3, day, tzinfo=UTC)
                row = {"series_id": key, "campaign_id": campaign}
                run = row | {"revision": 1, "fingerprint": "", "state": "refused"}
                point = row | {"parameter": "Ex", "performed_at": at, "in_baseline": False}
                point |= {"raw": 3e10, "standard_deviation": 1e8}
                session.execute(insert(tables["monitor_runs"]).values(run))
                session.execute(insert(tables["monitor_points"]).values(point))

    def deletions(self) -> None:
        path = f"projects/{self.lab.ids['project_id']}/members/{self.lab.ids['member']}"
        self.api.put(path, json={"role": "editor"}).raise_for_status()
        for noun in ("project", "structure", "campaign", "instrument", "monitor"):
            path = f"{noun}s/{self.lab.ids[f'deleted_{noun}_id']}"
            self.api.delete(path, headers={"If-Match": "*"}).raise_for_status()


def furnished(
    api: httpx.Client, name: str, chief: httpx.Client, member: str, sessions: Sessions, hook: str
) -> Lab:
    """The laboratory.

    Args:
        api: of the user whose it is.
        name: of that user.
        member: name of another.
        chief: of an administrator.
        sessions: on the service's database, for alarms, which take many campaigns.
        hook: the address of a receiver; one that does not answer is asked again and again.
    """
    made = Furnishing(api, chief, sessions)
    (user,) = ok(chief.get("users", params={"name": name}))["items"]
    made.lab.ids |= {"user_id": user["id"], "member": member, "hook": hook}
    for step in (
        made.structures,
        made.of_responses,
        made.of_campaigns,
        made.of_structures,
        made.updates,
        made.of_projects,
        made.attachments,
        made.deletions,
    ):
        step()
    made.ended()
    made.of_jobs()
    made.results()
    made.series()
    return made.lab
