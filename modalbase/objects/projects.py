"""Projects and the structures in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from modalbase.client.rest import require_known
from modalbase.objects.archives import Imported, import_archive
from modalbase.objects.campaigns import Campaign
from modalbase.objects.files import MESH_FORMATS
from modalbase.objects.finding import PROJECT, STRUCTURE
from modalbase.objects.jobs import Import, UpdateJob, update_jobs
from modalbase.objects.structures import CouponBatch, Forecast, Model, Monitor
from modalbase.objects.thing import Attached, Editable, Table

GEOMETRY = ("length_m", "width_m", "thickness_m")
STRUCTURE_INPUTS = (
    "length_sd_m", "width_sd_m", "height_sd_m", "thickness_sd_m", "density_sd_kg_m3",
    "nu_xy_sd", "fibre_angle_sd_deg", "ply_angle_sd_deg",
)  # fmt: skip
CAMPAIGN_INPUTS = (
    "clamp_compliance_sd", "sensor_mass_sd_kg", "channel_delay_sd_s",
    "window_rate_per_s", "window_time_constant_s", "window_rate_sd_per_s",
)  # fmt: skip
SHAPE = ("length_m", "width_m", "height_m", "ribs_m", "material", "walls")
PLY = ("E1_Pa", "E2_Pa", "G12_Pa", "G13_Pa", "G23_Pa", "nu_12")
WALL = "_thickness_m"
MATERIAL = ("Ex_Pa", "Ey_Pa", "Gxy_Pa", "Gxz_Pa", "Gyz_Pa", "nu_xy")
GROUPS = (
    ("geometry", GEOMETRY),
    ("material", MATERIAL),
    ("laminate", ("plies",)),
    ("inputs", STRUCTURE_INPUTS + CAMPAIGN_INPUTS),
    ("instruments", ("sensor_mass_kg", "sensor_point")),
)


class Project(Attached, Editable):
    """A project: structures, and the people who may see them."""

    noun = PROJECT

    def new_structure(
        self,
        name: str,
        *,
        confirm: bool = False,
        body: Mapping[str, Any] | None = None,
        **properties: Any,
    ) -> Structure:
        """Make a structure.

        Args:
            name: of it.
            body: as REST has it, to which the properties are added.
            confirm: take numbers that are unusual in SI, such as a modulus of 33 Pa, as they are.
            properties: nominal values, SI: `length_m`, `width_m`, `thickness_m`, `density_kg_m3`,
                and either `Ex_Pa`, `Ey_Pa`, `Gxy_Pa`, `Gxz_Pa`, `Gyz_Pa`, `nu_xy`, or `plies`; or
                `geometry`, `material`, `laminate` as REST has them. A
                body that is only to be identified needs none. How well they are known:
                `thickness_sd_m` and its like, 0 for
                exactly. A profile or panel: `shape` (`i`, `box`, `channel`, `angle`, `tee`,
                `panel`), `length_m`, `width_m`, `height_m`, of a panel `ribs_m`, of its walls
                `flange_thickness_m` and `web_thickness_m`, of a panel `plate_thickness_m` and
                `rib_thickness_m`, `density_kg_m3`, and of its material `E1_Pa`, `E2_Pa`, `G12_Pa`,
                `G13_Pa`, `G23_Pa`, `nu_12`; or a `shape` as REST has it.

        Raises:
            ClientError: the service refuses them.
        """
        stated = {**(body or {}), "name": name, **_nested(properties)}
        return self._make(Structure, stated, confirm)

    def structures(self) -> list[Structure]:
        """Its structures."""
        return self._list(Structure)

    def structure(
        self,
        which: str,
        *,
        create: bool = False,
        confirm: bool = False,
        body: Mapping[str, Any] | None = None,
        **properties: Any,
    ) -> Structure:
        """One of its structures by name or id.

        Args:
            which: of them.
            create: make one of this name where there is none, so that a script can be run twice.
            confirm: with `create`, take unusual numbers as they are.
            body: with `create`, as `new_structure` takes it.
            properties: with `create`, as `new_structure` takes them; the one that is there must be
                as stated.

        Raises:
            ClientError: there is none, several have the name, or the one that has it is not as
                stated.
        """
        stated = {**(body or {}), **_nested(properties)}
        return self._one(Structure, which, create, stated, confirm)

    def archive(self, file: str | Path) -> Path:
        """Write all of it, instruments, structures and campaigns, to a zip that others read without
        this service.
        """
        return self._save("archive", file)

    def import_archive(self, file: str | Path, *, again: bool = False) -> Imported:
        """Read an archive that a service wrote, with new ids: all but results, which stay in it,
        and monitors at rest.

        Each structure and campaign says in `meta.archive` which one it was, and in `sha256` of what
        archive.

        Args:
            file: the archive.
            again: read it though one of the same content was read before.

        Raises:
            ClientError: the archive is broken or no longer what was written, or its content is in a
                project already, in which case nothing is sent; or the service refuses a part of it.
            JobFailed: the service cannot read its FRFs.
        """
        return import_archive(self, Path(file), again=again)

    def instruments(self) -> Table:
        """Its hammers, sensors and analysers with their calibrations; campaigns name them by kind
        and serial number.
        """
        return Table(self._pages("instruments"), key="serial")

    def add_instrument(self, kind: str, serial: str, **fields: Any) -> dict[str, Any]:
        """Register a `hammer`, `sensor` or `analyser`.

        Args:
            kind: of it.
            serial: its number.
            fields: `model`, `notes`, `calibrations`, a list of `performed_on`, `valid_until`,
                `sensitivity`, `unit` and `certificate`.

        Raises:
            ClientError: the project has it already, or the service refuses it.
        """
        return self._post("instruments", {"kind": kind, "serial": serial, **fields})

    def change_instrument(self, instrument_id: str, **fields: Any) -> dict[str, Any]:
        """Change an instrument's `serial`, `model`, `notes`, or with `calibrations` its whole
        history.

        Raises:
            ClientError: the service refuses it.
        """
        address = f"instruments/{instrument_id}"
        tag = self.lab.connection.request("GET", address).headers["ETag"]
        changed: dict[str, Any] = self.lab.connection.call(
            "PATCH", address, json=fields, headers={"If-Match": tag}
        )
        return changed

    def members(self) -> list[dict[str, Any]]:
        """Who is in it, and in which role."""
        return self._pages("members")

    def add_member(self, user: str, role: str = "viewer") -> None:
        """Give a user, by name or id, the role `viewer`, `editor` or `owner`."""
        self.lab.rest.put_member(self.fields["id"], user, body={"role": role})


class Structure(Attached, Editable):
    """A specimen with its nominal properties; what was used is kept as a version."""

    noun = STRUCTURE

    def import_model(
        self,
        file: str | Path,
        units: str | None = None,
        *,
        accept: Sequence[str] = (),
        sections: Mapping[str, Any] | None = None,
        confirm: bool = False,
        wait: bool = True,
    ) -> Model:
        """Send a deck or mesh; once it was read, the structure's next version is that model.

        Args:
            file: of Abaqus or CalculiX (.inp) or Nastran (.bdf, .dat, .nas, .fem), or a .zip of one with
                what it includes; or matrices of any solver (.zip, .npz); or a mesh of gmsh (.msh),
                VTK (.vtu, .vtk) or UFF (.unv, .uff).
            units: that its numbers are in, length-force-mass: `m-N-kg`, `mm-N-t`, `in-lbf-slinch`
                and the like. A deck has none; without them the error says which fit.
            accept: answers to what is asked of it, each as the error prints it: cards that may be
                left out although modes change by that, and unusual values that are meant so, such
                as `density:GAUGE`.
            sections: of a mesh, by set: `{"skin": {"thickness_m": …, "material": {"E1_Pa": …}}}`
                with `isotropic` or `plies` as well, SI.
            confirm: take sections that are unusual in SI, such as a thickness of 4 m, as they are.
            wait: for the end of the reading.

        Raises:
            JobFailed: it could not be read; says line and card.
            ClientError: the service refuses it.
        """
        stated = {"units": units, "accept": list(accept), "confirm": confirm or None}
        sent = Model(self.lab, self._send("model", file, sections=sections, **stated))
        if wait:
            sent.wait().check()
            self.refresh()
        return sent

    @property
    def model(self) -> Model | None:
        """The model that it is, or None."""
        return None if self.fields["model"] is None else self.sent_model()

    def sent_model(self) -> Model:
        """The model that it is.

        Raises:
            ClientError: no model was sent.
        """
        return Model(self.lab, self._get("model"))

    def mesh(self, file: str | Path) -> Path:
        """Write its mesh: `.vtu` for viewers, `.uff` with sets 2411 and 2412, or `.json`.

        Raises:
            ClientError: the name says no format, or nothing is said of the structure that has a
                mesh.
        """
        return self._save("model/mesh", file, MESH_FORMATS)

    def forecast(self, **request: Any) -> Forecast:
        """Solve its nominal model, before anything is measured: modes, where to hit, and FRFs where
        damping is stated.

        Args:
            request: `boundary`, `modes` or `highest_hz`, `points` among which to choose,
                `points_to_measure`, `references`, `damping_ratio`, `line_spacing_hz`.

        Raises:
            ClientError: the structure lacks what a model needs.
        """
        return self._make(Forecast, request)

    def forecasts(self) -> list[Forecast]:
        """Its forecasts, newest first."""
        return self._list(Forecast)

    def plan(self, tests: Sequence[Mapping[str, Any]] = (), **request: Any) -> Table:
        """Which test would show most, the best first: boundaries, points to hit, coupons.

        Args:
            tests: to compare: `boundary`, `highest_hz`, `points_m` and so on; none compares the
                boundaries.
            request: `coupons`, `about`, `made` so far, `points_to_hit` and the others of
                `POST /structures/{id}/plans`.

        Raises:
            ClientError: the structure lacks what a model needs.
        """
        body = {**request, **({"tests": list(tests)} if tests else {})}
        return Table(self._post("plans", body)["items"])

    def new_campaign(
        self, name: str, boundary: str, *, confirm: bool = False, **fields: Any
    ) -> Campaign:
        """Make a campaign.

        Args:
            name: of it.
            confirm: take numbers that are unusual in SI, such as a sensor of 5 kg, as they are.
            boundary: `cantilever`, `free` or `simply_supported`; of a model that was sent `free` or
                `as_modelled`.
            fields: `performed_at`, conditions such as `temperature_c`, `notes`, `frame`,
                `instruments`; and `sensor_mass_kg` with `sensor_point`, which belong to the
                instruments; and `window_rate_per_s` or `window_time_constant_s`,
                `clamp_compliance_sd`, `sensor_mass_sd_kg`, `channel_delay_sd_s`, which belong to
                the inputs.

        Raises:
            ClientError: the service refuses them.
        """
        body = {"name": name, "boundary": boundary, **_nested(fields)}
        return self._make(Campaign, body, confirm)

    def add_recording(
        self,
        file: str | Path,
        boundary: str,
        *,
        name: str | None = None,
        mapping: Mapping[str, Any] | None = None,
        wait: bool = True,
        how: Mapping[str, Any] | None = None,
        **fields: Any,
    ) -> Import:
        """Send a file that is a campaign of its own, in one call; bytes that a campaign of the
        structure has are not read again.

        Args:
            file: of any format; monitors run once it was read.
            boundary: as of `new_campaign`.
            name: of the campaign; default: the file's without its end.
            mapping: which variable is what; its `recording` may take `performed_at` and
                `covariates` from the file.
            wait: for the end of the reading.
            how: `kind`, `quantity`, `complete` (false where more files follow) and `confirm` of
                `POST /structures/{id}/imports`.
            fields: `performed_at`, `covariates` and what else `new_campaign` takes.

        Returns:
            The import, with `campaign_id`; `already_imported` says whether it was there.

        Raises:
            JobFailed: the file could not be read.
            ClientError: the service refuses it.
        """
        path = Path(file)
        campaign = {"name": name or path.stem, "boundary": boundary, **_nested(fields)}
        options = dict(how or {})
        require_known("import_campaign", options)
        if "complete" in options:
            options["complete"] = bool(options["complete"])
        answer = self._send("imports", path, mapping=mapping, campaign=campaign, **options)
        sent = Import(self.lab, answer)
        return sent.wait().check() if wait else sent

    def imports(self, sha256: Sequence[str] = (), *, deleted: bool = False) -> list[Import]:
        """The files that were sent to its campaigns, newest first.

        Args:
            sha256: of some bytes: of these alone, which says what need not be sent.
            deleted: into deleted campaigns instead.
        """
        gone, parts = deleted or None, [sha256[at : at + 100] for at in range(0, len(sha256), 100)]
        pages = (
            self._pages("imports", sha256=part or None, deleted=gone) for part in parts or [()]
        )
        return [Import(self.lab, fields) for page in pages for fields in page]

    def campaigns(self) -> list[Campaign]:
        """Its campaigns."""
        return self._list(Campaign)

    def campaign(
        self, which: str, *, create: bool = False, confirm: bool = False, **fields: Any
    ) -> Campaign:
        """One of its campaigns by name or id.

        Args:
            which: of them.
            create: make one of this name where there is none, so that a script can be run twice.
            confirm: with `create`, take unusual numbers as they are.
            fields: with `create`, `boundary` and what else `new_campaign` takes; the one that is
                there must be as stated.

        Raises:
            ClientError: there is none, several have the name, or the one that has it is not as
                stated.
        """
        return self._one(Campaign, which, create, _nested(fields), confirm)

    def new_coupon_batch(
        self, name: str, constants: list[str], *, confirm: bool = False, **fields: Any
    ) -> CouponBatch:
        """Make a batch of coupon tests.

        Args:
            name: of it.
            constants: which of the structure's the tests measure: `Ex`, `Ey`, `Gxy`, `nu_xy`.
            confirm: take unusual numbers as they are.
            fields: `published` means where the specimens are not at hand, `conditions` of the
                tests, `sets` of a body in space that are of this material.
        """
        body = {"name": name, "constants": constants, **fields}
        return self._make(CouponBatch, body, confirm)

    def coupon_batches(self) -> list[CouponBatch]:
        """Its coupon batches."""
        return self._list(CouponBatch)

    def coupon_batch(
        self, which: str, *, create: bool = False, confirm: bool = False, **fields: Any
    ) -> CouponBatch:
        """One of its coupon batches by name or id; with `create` and `constants` made where there
        is none.
        """
        return self._one(CouponBatch, which, create, fields, confirm)

    def new_monitor(self, name: str, *, confirm: bool = False, **fields: Any) -> Monitor:
        """Watch it as it ages: a frozen recipe that runs on every complete campaign, or, with
        `watch="modes"`, its natural frequencies and damping ratios, which need no model.

        Args:
            name: of the monitor.
            confirm: take unusual numbers of the recipe's priors as they are.
            fields: as `POST /structures/{id}/monitors` takes them.
        """
        body = {"name": name, **fields}
        return self._make(Monitor, body, confirm)

    def monitors(self) -> list[Monitor]:
        """Its monitors."""
        return self._list(Monitor)

    def monitor(
        self, which: str, *, create: bool = False, confirm: bool = False, **fields: Any
    ) -> Monitor:
        """One of its monitors by name or id; with `create` made where there is none, of
        `fields`.
        """
        return self._one(Monitor, which, create, fields, confirm)

    def jobs(self) -> list[UpdateJob]:
        """Update jobs of its campaigns, newest first."""
        return update_jobs(self.lab, structure=self.fields["id"])


def _nested(properties: dict[str, Any]) -> dict[str, Any]:
    """Properties of a structure or a campaign that are stated flat, in the groups that REST has."""
    body = _shaped(properties)
    for group, names in GROUPS:
        if flat := {name: body.pop(name) for name in names if name in body}:
            body[group] = {**body.get(group, {}), **flat}
    return body


def _shaped(properties: dict[str, Any]) -> dict[str, Any]:
    """Properties with a shape that is stated by its kind and flat, as REST has it."""
    body = dict(properties)
    if not isinstance(body.get("shape"), str):
        return body
    shape = {"kind": body.pop("shape"), **{name: body.pop(name) for name in SHAPE if name in body}}
    if material := {name: body.pop(name) for name in PLY if name in body}:
        shape["material"] = material
    if walls := [name for name in body if name.endswith(WALL)]:
        shape["walls"] = {
            name.removesuffix(WALL): {"thickness_m": body.pop(name)} for name in walls
        }
    return {**body, "shape": shape}
