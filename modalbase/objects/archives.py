"""An archive read into a project of a service: everything gets new ids, and what it names is named
by those.

The first structure has a name of its own until all is there, which one client alone can take: so of
several that read an archive at one moment one does, and what a broken line leaves is seen for what
it is.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import UUID

from modalbase.client.errors import ClientError
from modalbase.objects.archive_file import ArchiveFile, broken
from modalbase.objects.files import send_file
from modalbase.objects.jobs import Import
from modalbase.objects.search import SearchResults

if TYPE_CHECKING:
    from modalbase.objects.campaigns import Campaign
    from modalbase.objects.projects import Project, Structure

_OF_THE_SERVICE = {
    *("id", "project_id", "structure_id", "version", "model", "replaced"),
    *("created_at", "updated_at", "deleted_at"),
}
"""Members of a thing that another service gives it anew."""
_MODE = ("frequency_hz", "damping_ratio", "frequency_sd_hz", "damping_sd", "shape")
_INSTRUMENT = ("kind", "serial", "model", "notes", "calibrations")
_BATCH = ("constants", "sets", "published", "conditions")
_COUPON = (
    *("standard", "E_Pa", "G_Pa", "nu", "strength_Pa", "ultimate_strain"),
    *("failure_code", "excluded", "exclusion_reason"),
)
_MONITOR = (
    *(
        "watch",
        "recipe",
        "modes",
        "priors",
        "boundary",
        "parameters",
        "baseline",
        "covariates",
        "false_alarm_rate",
        "horizon",
    ),
    *("pending", "chart", "expected_interval_days", "runs_on", "schedule"),
)


@dataclass(frozen=True)
class Imported:
    """What came of an archive.

    Attributes:
        ids: of instruments, structures, coupon batches, coupons, monitors, campaigns, time blocks,
            mode sets and attachments: as they were, to as they are.
        results: paths in the archive of results, which stay there: a service has the results that
            it computed.
    """

    ids: dict[str, str]
    results: list[str]


def import_archive(project: Project, path: Path, *, again: bool = False) -> Imported:
    """Read an archive into a project; everything gets ids of the service, and says in
    `meta.archive` where it came from.

    What came from an archive of the same content, in any project that one may see, is not brought
    in twice but with `again`.

    Where a part of it cannot be read, or the reading is interrupted, nothing stays: what was made
    is purged, or where the key may not do that deleted, and instruments that were there are as they
    were.

    Raises:
        ClientError: the archive is not what was written, or its content is there already, which is
            known before anything is sent; or another client reads it into the project now; or a
            part of it is none of an archive, or refused by the service.
    """
    with ArchiveFile(path) as archive:
        archive.check()
        if not again:
            _require_new(project, archive)
        reading = _Import(project, archive, unique=not again)
        try:
            return reading.whole()
        except BaseException as error:
            reading.undo()
            if isinstance(error, AlreadyThere) or not isinstance(error, _OF_A_PART):
                raise
            reason = (
                str(error) if isinstance(error, ClientError) else f"{type(error).__name__} {error}"
            )
            raise broken(
                f"{archive.last} of {path.name} is not as an archive is: {reason}; nothing of it"
                " stays"
            ) from error


_OF_A_PART = (AttributeError, ClientError, KeyError, TypeError, ValueError)
"""What a part raises that is none of an archive, or that the service refuses."""


class AlreadyThere(ClientError):  # noqa: N818  named for what happened
    """The content of an archive is in a project, or on its way into one."""


def _require_new(project: Project, archive: ArchiveFile, before: str | None = None) -> None:
    """Refuse an archive whose content is in a project already; `before` is the id of a structure,
    of which older ones count.
    """
    same = SearchResults(
        project.lab, "structures", {"filter": f"meta.archive.sha256 = '{archive.digest}'"}
    )
    for there in same:
        if before is not None and there["id"] >= before:  # ids are in the order of creation
            continue
        name, key, day = there["project.name"], there["project.id"], there["created_at"][:10]
        raise AlreadyThere(
            f"the project {name} ({key}) has what is in this archive since {day}; `again=True`,"
            " `--again`: have it twice"
        )


class _Import:
    """An archive on its way into a project; `ids` are those that are known by now."""

    def __init__(self, project: Project, archive: ArchiveFile, *, unique: bool) -> None:
        self.project, self.archive, self.ids = project, archive, dict[str, str]()
        self.made: list[Structure] = []
        self.calibrations_before: dict[str, list[Any] | None] = {}
        self.unique, self.name = unique, ""
        self.attached: list[str] = []  # to the project itself

    def undo(self) -> None:
        """Take back what was made: structures with all that is theirs, instruments,
        calibrations.
        """
        call = self.project.lab.connection.call
        for structure in self.made:
            structure.delete()
            try:
                call("POST", f"{structure.address}/purge")
            except ClientError as error:
                if error.status != HTTPStatus.FORBIDDEN:  # this key may not: it stays deleted
                    raise
        for key in self.attached:
            call("DELETE", f"attachments/{key}")
        for key, calibrations in self.calibrations_before.items():
            if calibrations is None:
                call("DELETE", f"instruments/{key}", headers={"If-Match": "*"})
            else:
                self.project.change_instrument(key, calibrations=calibrations)

    def whole(self) -> Imported:
        """All that the archive has: monitors last, since they are of a structure with its
        campaigns.
        """
        archive = self.archive
        structures: dict[str, Structure] = {}
        for was in map(archive.json, archive.names("structures/", "/structure.json")):
            structures[_id(was)] = self.structure(was)
        if archive.has("instruments.json"):
            self.instruments(archive.json("instruments.json"))
        self.below(structures)
        if archive.has("attachments.json"):
            for one in archive.json("attachments.json"):
                self.attachment(one)
        if self.name:
            call = self.project.lab.connection.call
            call("PATCH", self.made[0].address, json={"name": self.name}, headers={"If-Match": "*"})
        return Imported(
            self.ids, [name for name in archive.names("campaigns/", ".json") if "/results/" in name]
        )

    def below(self, structures: dict[str, Structure]) -> None:
        """Campaigns and monitors of structures, which are there by the ids that they had."""
        archive = self.archive
        for name in archive.names("campaigns/", "/campaign.json"):
            was = archive.json(name)
            if (structure := structures.get(str(was.get("structure_id")))) is None:
                raise broken(f"{name} is of a structure that the archive does not have")
            self.campaign(structure, was)
        for key, structure in structures.items():
            for name in archive.names(f"structures/{key}/monitors/", ".json"):
                self.monitor(structure, archive.json(name)["monitor"])

    def instruments(self, listed: list[dict[str, Any]]) -> None:
        """Those that the project has keep what it says of them, and get the calibrations that it
        does not know.
        """
        there = {(one["kind"], one["serial"]): one for one in self.project.instruments()}
        for was in listed:
            stated = {name: was[name] for name in _INSTRUMENT}
            if (known := there.get((was["kind"], was["serial"]))) is None:
                self.ids[_id(was)] = self.project.add_instrument(**stated)["id"]
                self.calibrations_before[self.ids[_id(was)]] = None
                continue
            self.ids[_id(was)] = known["id"]
            if more := [one for one in was["calibrations"] if one not in known["calibrations"]]:
                self.calibrations_before[known["id"]] = known["calibrations"]
                self.project.change_instrument(
                    known["id"], calibrations=[*known["calibrations"], *more]
                )

    def attachment(self, was: Mapping[str, Any]) -> None:
        """A file beside what is there now; one beside a result stays in the archive with it."""
        path, key = self.project.address, None
        for noun in ("structure", "campaign", "monitor"):
            if (key := was[f"{noun}_id"]) is not None:
                path = f"{noun}s/{self.ids[key]}"
                break
        if key is None and was["update_job_id"] is not None:
            return
        with self.archive.unpacked(f"attachments/{_id(was)}/file", str(was["name"])) as file:
            sent = send_file(
                self.project.lab.connection,
                f"{path}/attachments",
                file,
                caption=was["caption"] or None,
            )
        self.ids[_id(was)] = sent["id"]
        if key is None:
            self.attached.append(sent["id"])

    def structure(self, was: Mapping[str, Any]) -> Structure:
        """A structure with its deck and its coupons."""
        archive, folder = self.archive, f"structures/{_id(was)}"
        if self.unique and not self.made:
            made = self.first(was)
        else:
            made = self.project.new_structure(**self.stated(was), confirm=True)
            self.made.append(made)
        self.ids[_id(was)] = made.id
        if archive.has(f"{folder}/deck"):
            deck = archive.json(f"{folder}/model.json")
            with archive.unpacked(f"{folder}/deck", str(deck["filename"])) as file:
                options = {"accept": deck["accepted"], "sections": deck.get("sections")}
                made.import_model(file, deck["units"], **options, confirm=True)
        if archive.has(f"{folder}/coupon-batches.json"):
            for one in archive.json(f"{folder}/coupon-batches.json"):
                self.coupons(made, folder, one["batch"], one["coupons"])
        return made

    def first(self, was: Mapping[str, Any]) -> Structure:
        """The first structure, under the name that says that the archive is being read."""
        stated = self.stated(was)
        self.name, stated["name"] = (
            stated["name"],
            f"archive {self.archive.digest[:16]}, being read",
        )
        query = {"confirm": True, "unless_named": True}
        path = f"{self.project.address}/structures"
        answer = self.project.lab.connection.request("POST", path, params=query, json=stated)
        key = answer.json()["id"]
        if answer.status_code == HTTPStatus.OK:
            raise AlreadyThere(
                f"the archive is being read into the project {self.project.name} now, or that was"
                f" broken off: then delete its structure {stated['name']!r} ({key}) and read it"
                " again"
            )
        made = self.project.structure(key)
        self.made.append(made)
        _require_new(self.project, self.archive, key)
        return made

    def stated(self, was: Mapping[str, Any]) -> dict[str, Any]:
        """What a client states of a thing, with where it came from."""
        stated = {
            name: value
            for name, value in was.items()
            if name not in _OF_THE_SERVICE and value is not None
        }
        origin = {
            "id": _id(was),
            "created_at": was.get("created_at"),
            "sha256": self.archive.digest,
        }
        return {**stated, "meta": {**stated.get("meta", {}), "archive": origin}}

    def coupons(
        self,
        structure: Structure,
        folder: str,
        was: Mapping[str, Any],
        coupons: list[dict[str, Any]],
    ) -> None:
        """A batch; a raw curve is reduced anew from the testing machine's file."""
        batch = structure.new_coupon_batch(
            was["name"], **{name: was[name] for name in _BATCH}, confirm=True
        )
        self.ids[_id(was)] = batch.id
        for coupon in coupons:
            stated = {name: coupon[name] for name in _COUPON}
            if curve := coupon.get("curve"):
                counted = {name: stated[name] for name in ("excluded", "exclusion_reason")}
                about = {
                    name: value
                    for name, value in {**curve["request"], **counted}.items()
                    if value is not None
                }
                with self.archive.unpacked(
                    f"{folder}/curves/{_id(coupon)}/original", curve["file"]["filename"]
                ) as file:
                    made = batch.add_curve(file, confirm=True, **about)
            else:
                made = batch.add_coupon(coupon["specimen"], confirm=True, **stated)
            self.ids[_id(coupon)] = made["id"]

    def campaign(self, structure: Structure, was: Mapping[str, Any]) -> None:
        """A campaign with its points, hits, FRFs with their labels, and mode sets."""
        archive, folder, stated = self.archive, f"campaigns/{_id(was)}", self.stated(was)
        rates = {row["window_rate_per_s"] for row in archive.rows(f"{folder}/frfs.csv")}
        if (
            (stated.get("inputs") or {}).get("window_rate_per_s") is None
            and len(rates) == 1
            and (rate := rates.pop())
        ):
            stated["inputs"] = {**(stated.get("inputs") or {}), "window_rate_per_s": float(rate)}
        campaign = structure.new_campaign(**stated, confirm=True)
        self.ids[_id(was)] = campaign.id
        if archive.has(f"{folder}/frfs.uff"):
            with archive.unpacked(f"{folder}/frfs.uff", "frfs.uff") as file:
                sent = campaign.import_file(file)
            _label(campaign, archive.rows(f"{folder}/frfs.csv"), sent.id)
        elif points := archive.rows(f"{folder}/grid-points.csv"):
            campaign.set_grid_points(
                {"label": int(row["label"]), **{f"{a}_m": float(row[f"{a}_m"]) for a in "xyz"}}
                for row in points
            )
        self.hits(campaign, folder)
        self.recordings(campaign, folder)
        for one in archive.json(f"{folder}/mode-sets.json"):
            modes = [
                {name: mode[name] for name in _MODE}
                for mode in one["modes"]
                if mode["frequency_hz"] > 0
            ]
            if modes:
                about = {name: one[name] for name in ("excitation",) if name in one}
                self.ids[_id(one)] = campaign.new_mode_set(one["name"], modes, **about).id

    def hits(self, campaign: Campaign, folder: str) -> None:
        """The hits, and what was decided of them by hand; what is left of a hit without force or
        response stays.
        """
        archive = self.archive
        for name in archive.names(f"{folder}/hits/", ".npz"):
            mapping = archive.json(f"{name.removesuffix('.npz')}.json")
            forces = [channel["quantity"] == "force" for channel in mapping["channels"]]
            if any(forces) and not all(forces):
                with archive.unpacked(name, Path(name).name) as file:
                    form = {"mapping": json.dumps(mapping)}  # too long for an address
                    answer = campaign.lab.connection.submit(
                        f"{campaign.address}/records", file, form
                    )
                if "items" not in answer:
                    Import(campaign.lab, answer).wait().check()
        if archive.has(f"{folder}/hits.csv") and (rows := archive.rows(f"{folder}/hits.csv")):
            made = {_place(one.fields): one.id for one in campaign.records()}
            self.ids |= {_id(row): made[_place(row)] for row in rows if _place(row) in made}
            there = {place[:3] for place in made}
            for one in archive.json(f"{folder}/hit-decisions.json"):
                if (str(one["point"]), str(one["direction"]), str(one["hit"])) in there:
                    hit = {name: one[name] for name in ("point", "direction", "hit")}
                    why = f"{one['why']} ({one['by']}, {one['created_at'][:10]})"[-2000:]
                    campaign.judge(hit, good=one["good"], why=why)

    def recordings(self, campaign: Campaign, folder: str) -> None:
        """Recordings of responses, from the files that were sent; a processing makes their spectra
        anew.
        """
        archive, listed = self.archive, f"{folder}/recordings.json"
        for one in archive.json(listed) if archive.has(listed) else ():
            original = f"{folder}/recordings/{_id(one)}/original"
            if not archive.has(original):  # deleted by a retention rule
                continue
            with archive.unpacked(original, Path(one["filename"]).name) as file:
                campaign.import_file(file, kind="responses", mapping=one["mapping"])
            self.ids[_id(one)] = campaign.recordings()[-1].id

    def monitor(self, structure: Structure, was: Mapping[str, Any]) -> None:
        """A monitor, at rest and without the addresses of its mail: nobody has asked this service
        for its work yet.
        """
        recipe = dict(was["recipe"])
        if (batch := recipe.get("prior_from_coupon_batch")) is not None:
            recipe["prior_from_coupon_batch"] = self.ids[batch]
        stated = {name: was[name] for name in _MONITOR if name in was} | {
            "recipe": recipe,
            "active": False,
        }
        self.ids[_id(was)] = structure.new_monitor(was["name"], confirm=True, **stated).id


def _place(block: Mapping[str, Any]) -> tuple[str, ...]:
    """What names a time block within its campaign: first place and number of its hit."""
    names = ("force_point", "force_direction", "hit", "quantity", "point", "direction")
    return tuple(str(block[name]) for name in names)


def _label(campaign: Campaign, rows: list[dict[str, str]], import_id: str) -> None:
    for row in rows:
        tags, meta = json.loads(row["tags"]), json.loads(row["meta"])
        if tags or meta:
            which = {"point": row["response_point"], "direction": row["response_direction"]}
            which |= {
                "reference": row["reference_point"],
                "quantity": row["quantity"],
                "import_id": import_id,
            }
            campaign.label_frfs(tags=tags, meta=meta, **which)


def _id(was: Any) -> str:
    try:
        return str(UUID(was["id"]))
    except (KeyError, TypeError, ValueError, AttributeError):
        raise broken("something in the archive has no id") from None
