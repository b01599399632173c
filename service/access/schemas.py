"""Bodies of the access routes."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from uuid import UUID

from pydantic import ConfigDict

from service.access.projects import Role
from service.problems.schema import Name, StrictModel, Text, example


class _Out(StrictModel):
    model_config = ConfigDict(from_attributes=True, extra="ignore")


class ProjectIn(StrictModel):
    """A new project."""

    model_config = example(name="bridge deck")

    name: Name
    description: Text = ""


class ProjectOut(_Out):
    """A project."""

    id: UUID
    created_at: datetime
    name: str
    description: str


class MemberIn(StrictModel):
    """A member's role: viewers read, editors also write and start jobs, owners also manage members."""

    role: Role = "editor"


class MemberOut(_Out):
    """A member of a project."""

    project_id: UUID
    user_id: UUID
    user: str
    role: Role


class KeyIn(StrictModel):
    """A new key of one's own."""

    name: Name


class KeyOut(_Out):
    """A key, without its secret."""

    id: UUID
    created_at: datetime
    name: str
    prefix: str
    last_used_at: datetime | None
    revoked_at: datetime | None


class NewKeyOut(KeyOut):
    """A key just made; `key` is shown this once."""

    key: str


class AuditEventOut(_Out):
    """Who did what; no user where it was the operator at the command line, or the service itself."""

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
