"""Tables of users, keys, projects, members and the audit trail."""

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import CheckConstraint, ForeignKey, Index, LargeBinary, func, text
from sqlalchemy.orm import Mapped, mapped_column

from service.platform.db.base import Base, Identified, Labelled, label_indexes


class User(Identified, Base):
    """A person or a script, known by name."""

    __tablename__ = "users"

    name: Mapped[str] = mapped_column(unique=True)
    disabled_at: Mapped[datetime | None]
    administrator: Mapped[bool] = mapped_column(default=False, server_default=text("false"))


class ApiKey(Identified, Base):
    """An API key: its prefix finds the row, the SHA-256 of its secret proves it. The key itself is
    not kept.
    """

    __tablename__ = "api_keys"

    user_id: Mapped[UUID] = mapped_column(ForeignKey("users.id", ondelete="CASCADE"), index=True)
    name: Mapped[str]
    prefix: Mapped[str] = mapped_column(unique=True)
    secret_sha256: Mapped[bytes]
    scopes: Mapped[list[Any]] = mapped_column(
        server_default=text("""'["read", "write", "jobs", "admin"]'""")
    )
    last_used_at: Mapped[datetime | None]
    expires_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]


class BrowserSession(Identified, Base):
    """A browser's session of a key: the SHA-256 of its token, and when it ends."""

    __tablename__ = "browser_sessions"

    key_id: Mapped[UUID] = mapped_column(ForeignKey("api_keys.id", ondelete="CASCADE"), index=True)
    token_sha256: Mapped[bytes] = mapped_column(unique=True)
    expires_at: Mapped[datetime]


class IdempotencyKey(Base):
    """An `Idempotency-Key` of a user, and the answer to what came with it: see
    `service.platform.access.once`.

    Keys that came before there was this table have no SHA-256 of their request.
    """

    __tablename__ = "idempotency_keys"

    user_id: Mapped[UUID] = mapped_column(
        ForeignKey("users.id", ondelete="CASCADE"), primary_key=True
    )
    operation: Mapped[str] = mapped_column(primary_key=True)
    key: Mapped[str] = mapped_column(primary_key=True)
    request_sha256: Mapped[bytes | None]
    answer: Mapped[bytes] = mapped_column(LargeBinary)
    sealed: Mapped[bool] = mapped_column(server_default=text("false"))
    created_at: Mapped[datetime] = mapped_column(server_default=func.now())


class Project(Identified, Labelled, Base):
    """What people share: everything else belongs to one project."""

    __tablename__ = "projects"
    __table_args__ = label_indexes("projects")

    name: Mapped[str]
    description: Mapped[str] = mapped_column(server_default="")
    schemas: Mapped[dict[str, Any]] = mapped_column(server_default="{}")
    updated_at: Mapped[datetime] = mapped_column(server_default=func.now(), onupdate=func.now())
    archived_at: Mapped[datetime | None]
    deleted_at: Mapped[datetime | None]


class Member(Base):
    """A user's role in a project."""

    __tablename__ = "members"
    __table_args__ = (CheckConstraint("role IN ('viewer', 'editor', 'owner')", "role"),)

    project_id: Mapped[UUID] = mapped_column(
        ForeignKey("projects.id", ondelete="CASCADE"), primary_key=True
    )
    user_id: Mapped[UUID] = mapped_column(
        ForeignKey("users.id", ondelete="CASCADE"), primary_key=True, index=True
    )
    role: Mapped[str]


class AuditEvent(Identified, Base):
    """Who did what to which thing, written in the transaction that did it. A trigger refuses every
    change; what an event names may have been purged since.
    """

    __tablename__ = "audit_events"
    __table_args__ = (
        Index("ix_audit_events_project_id_id", "project_id", "id"),
        Index("ix_audit_events_user_id_id", "user_id", "id"),
    )

    user_id: Mapped[UUID | None]
    project_id: Mapped[UUID | None]
    action: Mapped[str]
    subject_type: Mapped[str]
    subject_id: Mapped[UUID | None]
    detail: Mapped[dict[str, Any]]
    request_id: Mapped[str | None]
