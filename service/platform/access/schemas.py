"""Bodies of the access routes."""

from datetime import datetime
from typing import Any
from uuid import UUID

from pydantic import ConfigDict, Field

from service.platform.access.keys import Scope
from service.platform.access.lookup import Role
from service.platform.access.metadata_schema import Schemas
from service.platform.web.bodies import (
    Meta,
    Name,
    RequestModel,
    StrictModel,
    Tags,
    Text,
    Time,
    example,
    not_null,
)


class _Out(StrictModel):
    model_config = ConfigDict(from_attributes=True, extra="ignore")


class ProjectIn(RequestModel):
    """A new project."""

    model_config = example(name="bridge deck")

    name: Name
    description: Text = ""
    tags: Tags = Field([])
    meta: Meta = Field({})


class ProjectPatch(RequestModel):
    """Members to change; what is in an archived project can be read and not changed."""

    model_config = example(description="spans 1 to 4")

    name: Name | None = None
    description: Text | None = None
    archived: bool | None = None
    tags: Tags | None = None
    meta: Meta | None = None
    schemas: Schemas | None = Field(
        None, description="by noun: a JSON Schema that what is entered in the project must fulfil"
    )

    _never_null = not_null("name", "description", "archived", "tags", "meta", "schemas")


class ProjectOut(_Out):
    """A project."""

    id: UUID
    created_at: datetime
    updated_at: datetime
    name: str
    description: str
    tags: list[str]
    meta: dict[str, Any]
    schemas: dict[str, Any]
    archived_at: datetime | None
    deleted_at: datetime | None


class MemberIn(RequestModel):
    """A member's role: viewers read, editors also write and start jobs, owners also manage
    members.
    """

    model_config = example(role="viewer")

    role: Role = "editor"


class MemberOut(_Out):
    """A member of a project."""

    project_id: UUID
    user_id: UUID
    user: str
    role: Role


class KeyIn(RequestModel):
    """A new key of one's own, with no more rights than the one that makes it."""

    model_config = example(
        name="night script", scopes=["read", "jobs"], expires_at="2027-01-01T00:00:00Z"
    )

    name: Name
    scopes: list[Scope] | None = Field(
        None, min_length=1, max_length=4, description="default: those of the key that makes it"
    )
    expires_at: Time | None = Field(None, description="default: when the key that makes it does")


class KeyOut(_Out):
    """A key, without its secret."""

    id: UUID
    created_at: datetime
    name: str
    prefix: str
    scopes: list[Scope]
    last_used_at: datetime | None
    expires_at: datetime | None
    revoked_at: datetime | None


class KeyEnd(RequestModel):
    """When a key is to expire."""

    model_config = example(expires_at="2027-01-01T00:00:00Z")

    expires_at: Time = Field(description="not later than the key expires already")


class UserOut(_Out):
    """A user, as administrators see them."""

    id: UUID
    created_at: datetime = Field(
        description="when the user, or the first membership under this name, was entered"
    )
    name: str
    disabled_at: datetime | None = Field(description="since when no key of theirs opens anything")
    administrator: bool = Field(description="whether they may look after other users")
    valid_keys: int = Field(
        description="keys that are neither revoked nor expired; 0 of who waits for a first one"
    )


class NewKeyOut(KeyOut):
    """A key just made; `key` is shown this once."""

    key: str


class SessionOut(_Out):
    """A browser's session just begun; its cookie came with the answer."""

    user: str = Field(description="whose key it is")
    expires_at: datetime = Field(description="when it ends by itself, UTC")
    csrf_token: str = Field(
        description="to be sent as `X-CSRF-Token` with every request that changes something"
    )


class AuditEventOut(_Out):
    """Who did what; no user where it was the operator at the command line, or the service
    itself.
    """

    id: UUID
    created_at: datetime
    user_id: UUID | None
    user: str | None
    project_id: UUID | None
    action: str
    subject_type: str
    subject_id: UUID | None
    detail: dict[str, Any]
    request_id: str | None
