"""What all nouns of the service have in common: their fields are attributes, they show and refresh themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

from modalbase.client.finding import Kind, find, find_or_make

if TYPE_CHECKING:
    from modalbase.client.connection import Connection
    from modalbase.objects.laboratory import Laboratory


class Thing:
    """One thing that the service stores.

    Attributes:
        lab: the laboratory that it is of.
        fields: the JSON that describes it, as it was last fetched. Each field is an attribute too: `campaign.temperature_c`.
    """

    word: ClassVar[str]
    """How a message calls one."""
    path: ClassVar[str]
    """Of one, below `/api/v1/`, with `{}` for its id."""

    def __init__(self, lab: Laboratory, fields: dict[str, Any]) -> None:
        self.lab = lab
        self.fields = fields

    def __getattr__(self, name: str) -> Any:
        if name != "fields" and name in self.fields:
            return self.fields[name]
        raise AttributeError(f"a {self.word} has no {name!r}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.fields]

    def __repr__(self) -> str:
        name = f" {self.fields['name']!r}" if "name" in self.fields else ""
        return f"<{self.word}{name} {self.fields['id']}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self.fields["id"] == other.fields["id"]

    def __hash__(self) -> int:
        return hash(self.fields["id"])

    @property
    def address(self) -> str:
        """Its path below `/api/v1/`."""
        return self.path.format(self.fields["id"])

    def refresh(self) -> Self:
        """Fetch it again.

        Raises:
            ClientError: it is gone, or the service does not answer.
        """
        self.fields = self.lab.connection.get(self.address)
        return self


class Editable(Thing):
    """A thing that can be changed and deleted; a change that somebody else made in between is not overwritten."""

    def change(self, *, confirm: bool = False, **fields: Any) -> Self:
        """Change fields; the others stay.

        Args:
            confirm: take unusual numbers of a structure or a campaign as they are.
            fields: as REST has them.

        Raises:
            ClientError: the service refuses, for example because somebody else has changed it since it was fetched.
        """
        answer = self.lab.connection.request("GET", self.address)
        tag = answer.headers.get("etag") if answer.json() == self.fields else None
        headers = {"If-Match": tag or '"changed-since"'}
        query = {"confirm": confirm or None}
        self.fields = self.lab.connection.call("PATCH", self.address, params=query, json=fields, headers=headers)
        return self

    def delete(self) -> None:
        """Hide it; an owner can restore it.

        Raises:
            ClientError: the service refuses.
        """
        self.lab.connection.call("DELETE", self.address, headers={"If-Match": "*"})


def found_or_made(
    service: Connection, kind: Kind, which: str, within: str | None, create: bool, body: dict[str, Any], **query: Any
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
        return find_or_make(service, kind, {"name": which, **body}, within, **query)
    if body or query:
        raise TypeError(f"{', '.join([*body, *query])} of a {kind.word} is stated with create=True")
    return find(service, kind, which, within=within)
