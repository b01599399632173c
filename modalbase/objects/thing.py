"""What the objects are made of: access to a service, things that it stores, tables, figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from modalbase.client.display import PLAIN_WIDTH, cell, print_table
from modalbase.client.errors import ClientError, Exit
from modalbase.client.rest import Rest
from modalbase.objects.files import FIGURES, save_file, send_file
from modalbase.objects.finding import Kind, all_of, find, find_id, find_or_make

if TYPE_CHECKING:
    from modalbase.client.connection import Connection


def library(name: str) -> Any:
    """A library that need not be there.

    Raises:
        ClientError: it is not installed.
    """
    try:
        return import_module(name)
    except ModuleNotFoundError:
        package = name.partition(".")[0]
        raise ClientError(
            f"{package} is not installed: pip install {package}", Exit.USAGE
        ) from None


class Access:
    """A service with a key.

    Attributes:
        connection: HTTP to the service.
        rest: every call of the REST contract as a method, for what the objects do not have.
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.rest = Rest(connection)

    def named(self, of: type[T], which: str, within: Thing | None = None) -> T:
        """A thing of which nothing but its id is known, for calls that need no more.

        Args:
            of: its class, such as `Campaign`.
            which: id, name, names from the project down, or `latest`. An id is taken as it is: the
                service judges it at the next call.
            within: the one above, where only what belongs to that is meant.

        Raises:
            ClientError: nothing has that name, or several things have.
        """
        above = None if within is None else within.fields["id"]
        return of(self, {"id": of._id_of(self.connection, which, above)})

    def names(self, noun: Kind) -> list[str]:
        """The names of all things of a noun that one may see."""
        return [str(one["name"]) for one in all_of(self.connection, noun)]


class Addressed:
    """What is at an address of a service.

    Attributes:
        lab: where it is of.
    """

    lab: Access

    @property
    def address(self) -> str:
        """Its path below `/api/v1/`."""
        raise NotImplementedError

    def _at(self, part: str) -> str:
        return f"{self.address}/{part}" if part else self.address

    def _get(self, part: str = "", **query: Any) -> dict[str, Any]:
        """The JSON of a part of it, or of itself."""
        return self.lab.connection.get(self._at(part), **query)

    def _pages(self, part: str = "", most: int | None = None, **query: Any) -> list[dict[str, Any]]:
        """The items of a list below it."""
        return list(self.lab.connection.pages(self._at(part), most, **query))

    def _post(self, part: str, body: Any, confirm: bool = False) -> dict[str, Any]:
        """The JSON that answers a body."""
        return self.lab.connection.post(self._at(part), body, confirm=confirm or None)

    def _call(self, method: str, part: str = "", *, replaced: bool = False, **how: Any) -> Any:
        """What answers any call; `replaced` names the version that is there now, as replaced."""
        if replaced:
            there = self.lab.connection.request("GET", self._at(part))
            how["headers"] = {"If-Match": there.headers["etag"]}
        return self.lab.connection.call(method, self._at(part), **how)

    def _send(self, part: str, file: str | Path, **how: Any) -> dict[str, Any]:
        """The JSON that answers a file, as `send_file`."""
        return send_file(self.lab.connection, self._at(part), Path(file), **how)

    def _save(
        self,
        part: str,
        file: str | Path,
        formats: Mapping[str, str] | None = None,
        advice: str = "",
        **query: Any,
    ) -> Path:
        """Write a part of it to a file, as `save_file`."""
        return save_file(self.lab.connection, self._at(part), file, formats, advice, **query)


class Thing(Addressed):
    """One thing that the service stores.

    Attributes:
        lab: the laboratory that it is of.
        fields: the JSON that describes it, as it was last fetched. Each field is an attribute too:
            `campaign.temperature_c`.
    """

    noun: ClassVar[Kind]
    """Its noun: how a message calls one, where it is, and where things of its kind are listed."""

    def __init__(self, lab: Access, fields: dict[str, Any]) -> None:
        self.lab = lab
        self.fields = fields

    def __getattr__(self, name: str) -> Any:
        if name != "fields" and name in self.fields:
            return self.fields[name]
        raise AttributeError(f"there is no {name!r} of this {self.noun.word}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.fields]

    def __repr__(self) -> str:
        name = f" {self.fields['name']!r}" if "name" in self.fields else ""
        return f"<{self.noun.word}{name} {self.fields['id']}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self.fields["id"] == other.fields["id"]

    def __hash__(self) -> int:
        return hash(self.fields["id"])

    @classmethod
    def _id_of(cls, service: Connection, which: str, within: str | None, /) -> str:
        """The id of the one that is meant, as `Access.named`."""
        return find_id(service, cls.noun, which, within)

    @property
    def address(self) -> str:
        """Its path below `/api/v1/`."""
        return self.noun.path.format(self.fields["id"])

    def refresh(self) -> Self:
        """Fetch it again.

        Raises:
            ClientError: it is gone, or the service does not answer.
        """
        self.fields = self._get()
        return self

    def _list(self, of: type[T], **narrowed: Any) -> list[T]:
        """Things of a kind below it."""
        path = of.noun.below.format(self.fields["id"])
        return [of(self.lab, fields) for fields in self.lab.connection.pages(path, **narrowed)]

    def _make(
        self,
        of: type[T],
        body: Mapping[str, Any],
        confirm: bool = False,
        headers: dict[str, str] | None = None,
    ) -> T:
        """A new thing of a kind below it."""
        path = of.noun.below.format(self.fields["id"])
        return of(self.lab, self.lab.connection.post(path, body, headers, confirm=confirm or None))

    def _one(
        self, of: type[T], which: str, create: bool, body: dict[str, Any], confirm: bool = False
    ) -> T:
        """One of the things of a kind below it; with `create` made where there is none."""
        query = {"confirm": True} if confirm else {}
        return of(
            self.lab,
            find_or_create(
                self.lab.connection, of.noun, which, self.fields["id"], create, body, **query
            ),
        )


T = TypeVar("T", bound=Thing)


class Editable(Thing):
    """A thing that can be changed and deleted; a change that somebody else made in between is not
    overwritten.
    """

    def change(self, *, confirm: bool = False, **fields: Any) -> Self:
        """Change fields; the others stay.

        Args:
            confirm: take unusual numbers of a structure or a campaign as they are.
            fields: as REST has them.

        Raises:
            ClientError: the service refuses, for example because somebody else has changed it since
                it was fetched.
        """
        answer = self.lab.connection.request("GET", self.address)
        # what was found by name has the names above it too
        same = answer.json().items() <= self.fields.items()
        tag = answer.headers.get("etag") if same else None
        headers = {"If-Match": tag or '"changed-since"'}
        query = {"confirm": confirm or None}
        self.fields = self._call("PATCH", params=query, json=fields, headers=headers)
        return self

    def delete(self) -> None:
        """Hide it; an owner can restore it.

        Raises:
            ClientError: the service refuses.
        """
        self._call("DELETE", headers={"If-Match": "*"})


class Attachment(Editable):
    """A file beside a project, structure, campaign, update or monitor."""

    noun = Kind("attachment", "attachments/{}", "{}/attachments")

    def save(self, file: str | Path | None = None) -> Path:
        """Write it to a file, by default of its own name in this folder."""
        return self._save("file", Path(self.fields["name"]).name if file is None else file)

    def delete(self) -> None:
        """Remove it for good.

        Raises:
            ClientError: the service refuses.
        """
        self._call("DELETE")


class Attached(Thing):
    """A thing that files may be kept beside."""

    def attach(self, file: str | Path, caption: str = "") -> Attachment:
        """Keep a file beside it: a photograph, a drawing, notes, anything.

        Args:
            file: whatever it is; PNG, JPEG, WebP and PDF are shown on pages, and photographs in the
                report.
            caption: what it shows.

        Raises:
            ClientError: the service refuses, for one because the project has no room.
        """
        return Attachment(self.lab, self._send("attachments", file, caption=caption or None))

    def attachments(self) -> list[Attachment]:
        """The files beside it, oldest first."""
        return [Attachment(self.lab, fields) for fields in self._pages("attachments")]


def find_or_create(
    service: Connection,
    kind: Kind,
    which: str,
    within: str | None,
    create: bool,
    body: dict[str, Any],
    **query: Any,
) -> dict[str, Any]:
    """What `project.structure(which, create=…, …)` and its like give.

    Args:
        service: the connection.
        kind: of the thing.
        which: id, name or `latest`; with `create` a name.
        within: id of the one above.
        create: make it where there is none.
        body: what is stated of it, which only `create` has use for.
        query: of the request that makes it.

    Raises:
        ClientError: as `find` and `find_or_make`.
        TypeError: something is stated of it without `create`.
    """
    if create:
        return find_or_make(service, kind, {**body, "name": which}, within, **query)
    if body or query:
        raise TypeError(f"{', '.join([*body, *query])} of a {kind.word} is stated with create=True")
    return find(service, kind, which, within=within)


class Table(Sequence[Mapping[str, Any]]):
    """Rows of named values, SI in full; printing shows them in a laboratory's units where the table
    has some.

    `table[0]` is a row, `table["Ex"]` the row of that name, `table.column("estimate")` a column,
    `len(table)` the number of rows, `table.to_pandas()` a DataFrame.

    Attributes:
        rows: the values.
        key: the column that names a row.
    """

    def __init__(
        self,
        rows: Sequence[Mapping[str, Any]],
        key: str = "name",
        shown: tuple[Sequence[str], Sequence[Sequence[Any]]] | None = None,
    ) -> None:
        self.rows = list(rows)
        self.key = key
        self._shown = shown

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Mapping[str, Any]]:
        return iter(self.rows)

    def __getitem__(self, which: Any) -> Any:
        if not isinstance(which, str):
            return self.rows[which]
        for row in self.rows:
            if row.get(self.key) == which:
                return row
        raise KeyError(
            f"{which!r}; there is {', '.join(str(row.get(self.key)) for row in self.rows)}"
        )

    def column(self, name: str) -> list[Any]:
        """The values of a column, None where a row has none."""
        return [row.get(name) for row in self.rows]

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`, SI in full.

        Raises:
            ClientError: pandas is not installed.
        """
        return library("pandas").DataFrame(self.rows)

    def __str__(self) -> str:
        from rich.console import Console

        text = StringIO()
        print_table("", *self.cells(), Console(file=text, width=PLAIN_WIDTH))
        return "\n".join(line.rstrip() for line in text.getvalue().splitlines())

    __repr__ = __str__

    def _repr_html_(self) -> str:
        columns, rows = self.cells()
        head = "".join(f"<th>{escape(name)}</th>" for name in columns)
        body = "".join(
            f"<tr>{''.join(f'<td>{escape(cell(value))}</td>' for value in row)}</tr>"
            for row in rows
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def cells(self) -> tuple[Sequence[str], Sequence[Sequence[Any]]]:
        """Headings and rows as printing shows them."""
        if self._shown is not None:
            return self._shown
        columns = list(dict.fromkeys(name for row in self.rows for name in row))
        return columns, [[row.get(name) for name in columns] for row in self.rows]


class Figure:
    """A figure; a notebook shows it as SVG, and needs no library for that.

    Attributes:
        lab: where it is of.
        address: its path below `/api/v1/`.
        query: which figure of that address.
    """

    def __init__(self, lab: Access, address: str, query: dict[str, Any]) -> None:
        self.lab, self.address, self.query = lab, address, query

    def __repr__(self) -> str:
        return f"<Figure {self.address}; .save(FILE), .plotly()>"

    def content(self, file_format: str) -> Any:
        """The figure as `svg`, `png` or `pdf` bytes, or as the JSON of `plotly`.

        Raises:
            ClientError: there is none of that name, or nothing to draw.
        """
        return self.lab.connection.call(
            "GET", self.address, params={**self.query, "format": file_format}
        )

    def save(self, file: str | Path) -> Path:
        """Write it to a file: `.svg`, `.png`, `.pdf`, or `.json` for Plotly.

        Raises:
            ClientError: the file's name says none of these.
        """
        return save_file(self.lab.connection, self.address, file, FIGURES, **self.query)

    def plotly(self) -> dict[str, Any]:
        """The figure as Plotly has it: `plotly.graph_objects.Figure(figure.plotly())`."""
        document: dict[str, Any] = self.content("plotly")
        return document

    def _repr_svg_(self) -> str:
        content: bytes = self.content("svg")
        return content.decode()
