"""Projects, and the structures in them."""

from __future__ import annotations

from typing import Any

from modalbase.client.finding import BATCH, CAMPAIGN, MONITOR, STRUCTURE, Kind
from modalbase.objects.campaigns import Campaign
from modalbase.objects.coupons import CouponBatch
from modalbase.objects.jobs import UpdateJob
from modalbase.objects.monitors import Monitor
from modalbase.objects.thing import Editable, Thing, found_or_made

GEOMETRY = ("length_m", "width_m", "thickness_m")
STRUCTURE_INPUTS = (
    "length_sd_m",
    "width_sd_m",
    "thickness_sd_m",
    "density_sd_kg_m3",
    "nu_xy_sd",
    "fibre_angle_sd_deg",
    "ply_angle_sd_deg",
)
CAMPAIGN_INPUTS = (
    "clamp_compliance_sd",
    "sensor_mass_sd_kg",
    "channel_delay_sd_s",
    "window_rate_per_s",
    "window_time_constant_s",
    "window_rate_sd_per_s",
)
MATERIAL = ("Ex_Pa", "Ey_Pa", "Gxy_Pa", "Gxz_Pa", "Gyz_Pa", "nu_xy")
GROUPS = (
    ("geometry", GEOMETRY),
    ("material", MATERIAL),
    ("laminate", ("plies",)),
    ("inputs", STRUCTURE_INPUTS + CAMPAIGN_INPUTS),
    ("instruments", ("sensor_mass_kg", "sensor_point")),
)


class Project(Editable):
    """A project: structures, and the people who may see them."""

    word, path = "project", "projects/{}"

    def new_structure(self, name: str, *, confirm: bool = False, **properties: Any) -> Structure:
        """Make a structure.

        Args:
            name: of it.
            confirm: take numbers that are unusual in SI, such as a modulus of 33 Pa, as they are.
            properties: nominal values, SI: `length_m`, `width_m`, `thickness_m`, `density_kg_m3`, and either `Ex_Pa`, `Ey_Pa`,
                `Gxy_Pa`, `Gxz_Pa`, `Gyz_Pa`, `nu_xy`, or `plies`; or `geometry`, `material`, `laminate` as REST has them. A
                body that is only to be identified needs none. How well they are known: `thickness_sd_m` and its like, 0 for
                exactly.

        Raises:
            ClientError: the service refuses them.
        """
        body = {"name": name, **_nested(properties)}
        return Structure(
            self.lab, self.lab.connection.post(f"{self.address}/structures", body, confirm=confirm or None)
        )

    def structures(self) -> list[Structure]:
        """Its structures."""
        return [Structure(self.lab, one) for one in self.lab.connection.pages(f"{self.address}/structures")]

    def structure(self, which: str, *, create: bool = False, confirm: bool = False, **properties: Any) -> Structure:
        """One of its structures by name or id.

        Args:
            which: of them.
            create: make one of this name where there is none, so that a script can be run twice.
            confirm: with `create`, take unusual numbers as they are.
            properties: with `create`, as `new_structure` takes them; the one that is there must be as stated.

        Raises:
            ClientError: there is none, several have the name, or the one that has it is not as stated.
        """
        return Structure(self.lab, _within(self, STRUCTURE, which, create, _nested(properties), confirm))

    def members(self) -> list[dict[str, Any]]:
        """Who is in it, and in which role."""
        return list(self.lab.connection.pages(f"{self.address}/members"))

    def add_member(self, user: str, role: str = "viewer") -> None:
        """Give a user, by name or id, the role `viewer`, `editor` or `owner`."""
        self.lab.rest.put_member(self.fields["id"], user, body={"role": role})


class Structure(Editable):
    """A specimen with its nominal properties; what was used is kept as a version."""

    word, path = "structure", "structures/{}"

    def new_campaign(self, name: str, boundary: str, *, confirm: bool = False, **fields: Any) -> Campaign:
        """Make a campaign.

        Args:
            name: of it.
            confirm: take numbers that are unusual in SI, such as a sensor of 5 kg, as they are.
            boundary: `cantilever`, `free` or `simply_supported`.
            fields: `performed_at`, `temperature_c`, `humidity_percent`, `notes`, `frame`, `instruments`; and `sensor_mass_kg`
                with `sensor_point`, which belong to the instruments; and `window_rate_per_s` or `window_time_constant_s`,
                `clamp_compliance_sd`, `sensor_mass_sd_kg`, `channel_delay_sd_s`, which belong to the inputs.

        Raises:
            ClientError: the service refuses them.
        """
        body = {"name": name, "boundary": boundary, **_nested(fields)}
        return Campaign(self.lab, self.lab.connection.post(f"{self.address}/campaigns", body, confirm=confirm or None))

    def campaigns(self) -> list[Campaign]:
        """Its campaigns."""
        return [Campaign(self.lab, one) for one in self.lab.connection.pages(f"{self.address}/campaigns")]

    def campaign(self, which: str, *, create: bool = False, confirm: bool = False, **fields: Any) -> Campaign:
        """One of its campaigns by name or id.

        Args:
            which: of them.
            create: make one of this name where there is none, so that a script can be run twice.
            confirm: with `create`, take unusual numbers as they are.
            fields: with `create`, `boundary` and what else `new_campaign` takes; the one that is there must be as stated.

        Raises:
            ClientError: there is none, several have the name, or the one that has it is not as stated.
        """
        return Campaign(self.lab, _within(self, CAMPAIGN, which, create, _nested(fields), confirm))

    def new_coupon_batch(self, name: str, constants: list[str], *, confirm: bool = False, **fields: Any) -> CouponBatch:
        """Make a batch of coupon tests.

        Args:
            name: of it.
            constants: which of the structure's the tests measure: `Ex`, `Ey`, `Gxy`, `nu_xy`.
            confirm: take unusual numbers as they are.
            fields: `published` means where the specimens are not at hand, `conditions` of the tests.
        """
        body = {"name": name, "constants": constants, **fields}
        made = self.lab.connection.post(f"{self.address}/coupon-batches", body, confirm=confirm or None)
        return CouponBatch(self.lab, made)

    def coupon_batches(self) -> list[CouponBatch]:
        """Its coupon batches."""
        return [CouponBatch(self.lab, one) for one in self.lab.connection.pages(f"{self.address}/coupon-batches")]

    def coupon_batch(self, which: str, *, create: bool = False, confirm: bool = False, **fields: Any) -> CouponBatch:
        """One of its coupon batches by name or id; with `create` and `constants` made where there is none."""
        return CouponBatch(self.lab, _within(self, BATCH, which, create, fields, confirm))

    def new_monitor(self, name: str, *, confirm: bool = False, **fields: Any) -> Monitor:
        """Watch it as it ages: a frozen recipe that runs on every complete campaign.

        Args:
            name: of the monitor.
            confirm: take unusual numbers of the recipe's priors as they are.
            fields: as `POST /structures/{id}/monitors` takes them.
        """
        body = {"name": name, **fields}
        return Monitor(self.lab, self.lab.connection.post(f"{self.address}/monitors", body, confirm=confirm or None))

    def monitors(self) -> list[Monitor]:
        """Its monitors."""
        return [Monitor(self.lab, one) for one in self.lab.connection.pages(f"{self.address}/monitors")]

    def monitor(self, which: str, *, create: bool = False, confirm: bool = False, **fields: Any) -> Monitor:
        """One of its monitors by name or id; with `create` made where there is none, of `fields`."""
        return Monitor(self.lab, _within(self, MONITOR, which, create, fields, confirm))

    def jobs(self) -> list[UpdateJob]:
        """Update jobs of its campaigns, newest first."""
        return self.lab.jobs(structure=self.fields["id"])


def _within(above: Thing, kind: Kind, which: str, create: bool, body: dict[str, Any], confirm: bool) -> dict[str, Any]:
    """One of the things below another, by id or name; with `create` made where there is none."""
    query = {"confirm": True} if confirm else {}
    return found_or_made(above.lab.connection, kind, which, above.fields["id"], create, body, **query)


def _nested(properties: dict[str, Any]) -> dict[str, Any]:
    """Properties of a structure or a campaign that are stated flat, in the groups that REST has."""
    body = dict(properties)
    for group, names in GROUPS:
        if flat := {name: body.pop(name) for name in names if name in body}:
            body[group] = {**body.get(group, {}), **flat}
    return body
