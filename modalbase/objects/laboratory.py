"""The way in: a service and a key, and what one may see there."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Self

from modalbase.client.display import Written
from modalbase.client.endpoint import find_endpoint
from modalbase.client.results import parameter_cells
from modalbase.objects.campaigns import Campaign
from modalbase.objects.finding import CAMPAIGN, MONITOR, PROJECT, STRUCTURE, find
from modalbase.objects.jobs import Result, UpdateJob, update_jobs
from modalbase.objects.people import People
from modalbase.objects.projects import Project, Structure
from modalbase.objects.search import SearchResults
from modalbase.objects.structures import Alarm, Monitor
from modalbase.objects.thing import Table, find_or_create

if TYPE_CHECKING:
    import httpx

TOGETHER = 8
"""Results that are fetched at a time."""


def connect(url: str | None = None, key: str | None = None) -> Laboratory:
    """A laboratory: the service that is stated, or else found.

    The address comes from `url`, MODALBASE_URL, the profile that `modalbase login` saved, or the
    `modalbase up` that runs on this machine; the key from `key`, MODALBASE_API_KEY, the profile, or
    the data folder of that service.

        lab = modalbase.connect() campaign = lab.campaign("spring 2026")

    Args:
        url: of the service, such as `http://127.0.0.1:8000`.
        key: API key.

    Raises:
        ClientError: none is found, the service does not answer, or it refuses the key.
    """
    place = find_endpoint(url, key)
    lab = Laboratory.at(place.url, place.key)
    try:
        lab.check()
    except BaseException:
        lab.connection.close()
        raise
    return lab


class Laboratory(People):
    """What a key may see of a service; a context manager that closes its connections.

    Things are found by id, by name, by names from the project down (`"bridge/beam/March"`), or as
    `"latest"`.

    Attributes:
        connection: HTTP to the service.
        rest: every call of the REST contract as a method, for what the objects do not have.
    """

    @classmethod
    def at(cls, url: str, key: str) -> Self:
        """That of a service and a key, whatever profile there is. Nothing is sent; `check` asks
        whether the service takes the key.

        Raises:
            ClientError: the URL or the key can be none.
        """
        from modalbase.client.connection import Connection

        return cls(Connection(url, key))

    @classmethod
    def over(cls, http: httpx.Client) -> Self:
        """That of an httpx client with trust, key and base URL of its own; who made the client
        closes it.
        """
        from modalbase.client.connection import Connection

        return cls(Connection.over(http))

    def check(self) -> None:
        """Ask the service.

        Raises:
            ClientError: it does not answer, or it refuses the key.
        """
        self.connection.get("projects", limit=1)

    def __repr__(self) -> str:
        return f"<Laboratory {self.connection.url}>"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.connection.close()

    def new_project(self, name: str, description: str = "", *, again: bool = False) -> Project:
        """Make a project; you are its owner.

        Args:
            name: of it.
            description: of it.
            again: another one of that name is meant, and needs no warning.

        Warns:
            UserWarning: you are in one of that name already, so that the name alone no longer says
            which is meant.
        """
        if not again and any(one.name == name for one in self.projects()):
            there = f"lab.project({name!r}, create=True)"
            warnings.warn(
                f"there is a project {name!r} already; {there} gives that one", stacklevel=2
            )
        return Project(
            self, self.connection.post("projects", {"name": name, "description": description})
        )

    def projects(self) -> list[Project]:
        """The projects that you are a member of."""
        return [Project(self, fields) for fields in self.connection.pages("projects")]

    def project(self, which: str, *, create: bool = False, **fields: Any) -> Project:
        """A project by id, name or `latest`.

        Args:
            which: of them.
            create: make one of this name where there is none, so that a script can be run twice.
            fields: with `create`, `description` of the project.

        Raises:
            ClientError: there is none, several have the name, or the one that has it is not as
                stated.
        """
        return Project(self, find_or_create(self.connection, PROJECT, which, None, create, fields))

    def structure(self, which: str) -> Structure:
        """A structure by id, name, `project/structure` or `latest`."""
        return Structure(self, find(self.connection, STRUCTURE, which))

    def campaign(self, which: str) -> Campaign:
        """A campaign by id, name, `project/structure/campaign` or `latest`."""
        return Campaign(self, find(self.connection, CAMPAIGN, which))

    def monitor(self, which: str) -> Monitor:
        """A monitor by id, name, `project/structure/monitor` or `latest`."""
        return Monitor(self, find(self.connection, MONITOR, which))

    def monitors(self) -> list[Monitor]:
        """The monitors of all structures that you may see."""
        return [Monitor(self, fields) for fields in self.connection.pages("monitors")]

    def job(self, which: str = "latest") -> UpdateJob:
        """An update job by id, or the one that was queued last."""
        return self.named(UpdateJob, which).refresh()

    def jobs(self, most: int | None = None, **narrowed: Any) -> list[UpdateJob]:
        """Update jobs, newest first.

        Args:
            most: how many at most; None for all.
            narrowed: to a `project`, `structure` or `campaign` by id, to a `status`.
        """
        return update_jobs(self, most, **narrowed)

    def results(self, jobs: Iterable[UpdateJob] | None = None, **narrowed: Any) -> Table:
        """Results of many jobs as one table, a row a job: verdict, and each parameter with its
        uncertainty.

        The columns of a parameter `Ex` are `Ex`, `Ex_sd`, `Ex_low`, `Ex_high` and
        `Ex_identifiable`, in SI. Printed it is one column a parameter, in a laboratory's units.

        Args:
            jobs: whose results; by default all that have succeeded.
            narrowed: to a `project`, `structure` or `campaign` by id, where no jobs are stated.

        Raises:
            ClientError: one of them has no result.
        """
        selected = list(self.jobs(**{"status": "succeeded", **narrowed}) if jobs is None else jobs)
        with ThreadPoolExecutor(TOGETHER) as pool:
            results = list(pool.map(UpdateJob.result, selected))
        read = [_read(result) for result in results]
        columns = list(dict.fromkeys(name for each in read for name in each))
        shown = columns, [[each.get(name) for name in columns] for each in read]
        return Table(
            [_row(*pair) for pair in zip(selected, results, strict=True)], key="job", shown=shown
        )

    def find(
        self,
        noun: str,
        filter: str | None = None,
        *,
        words: str | None = None,
        sort: str | None = None,
        fields: Iterable[str] = (),
    ) -> SearchResults:
        """What a search over all your projects finds, fetched as it is needed.

            lab.find("results", "Ex < 30e9 AND verdict = 'usable'", sort="Ex").to_pandas()

        Args:
            noun: `structures`, `campaigns`, `frfs`, `modes`, `results`, `coupons`, `records` or
                `monitors`.
            filter: CQL2 text, such as `campaign.temperature_c > 25`.
            words: that names, notes or instruments have.
            sort: a field; `-` in front for descending.
            fields: the columns; by default a choice of them.
        """
        query = {"filter": filter, "q": words, "sort": sort, "fields": ",".join(fields) or None}
        return SearchResults(self, noun, query)

    def alarms(self, **narrowed: Any) -> list[Alarm]:
        """Alarms of all monitors that you may see, newest first.

        Args:
            narrowed: to a `state`, a `monitor` or a `project`.
        """
        return [Alarm(self, fields) for fields in self.connection.pages("alarms", **narrowed)]

    def pages(self, path: str, **params: Any) -> Iterator[dict[str, Any]]:
        """The items of any list of the contract, through all of its pages."""
        return self.connection.pages(path, **params)


def _read(result: Result) -> dict[str, Any]:
    """A row of the table as people read it."""
    columns, rows = parameter_cells(result.document["parameters"])
    name, unit, estimate, sd = (
        columns.index(each) for each in ("parameter", "unit", "estimate", "± sd")
    )
    values = {
        f"{row[name]} [{row[unit]}]" if row[unit] not in ("", "1") else row[name]: Written(
            row[estimate]
            if row[sd] is None
            else f"{row[estimate]} {'' if row[sd][0] == '+' else '± '}{row[sd]}"
        )
        for row in rows
    }
    return {"job": result.job, "verdict": result.verdict.replace("_", " "), **values}


def _row(job: UpdateJob, result: Result) -> dict[str, Any]:
    row = {
        "job": job.fields["id"], "campaign": job.fields["campaign_id"], "finished_at": job.fields["finished_at"],
        "verdict": result.verdict or None, "warnings": len(result.warnings),
    }  # fmt: skip
    for parameter in result.parameters:
        name = parameter["name"]
        low, high = parameter["interval_95"] or (None, None)
        row |= {
            name: parameter["estimate"], f"{name}_sd": parameter["standard_deviation"],
            f"{name}_low": low, f"{name}_high": high, f"{name}_identifiable": parameter["identifiable"],
        }  # fmt: skip
    return row
