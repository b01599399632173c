"""Tables of structures: a row per structure, a row per version that never changes."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import ForeignKey, Index, UniqueConstraint, func
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, mapped_column, relationship

from service.db.base import Base, Identified


class Structure(Identified, Base):
    """A structure; what it physically is stands in its versions."""

    __tablename__ = "structures"
    __table_args__ = (Index(None, "project_id", "id"),)

    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    name: Mapped[str]
    version: Mapped[int] = mapped_column(default=1)
    updated_at: Mapped[datetime] = mapped_column(server_default=func.now(), onupdate=func.now())
    deleted_at: Mapped[datetime | None]

    versions: Mapped[list[StructureVersion]] = relationship(
        back_populates="structure", order_by="StructureVersion.number", passive_deletes=True
    )


class StructureVersion(Identified, Base):
    """One version of a structure: written once, referred to by results, never changed."""

    __tablename__ = "structure_versions"
    __table_args__ = (UniqueConstraint("structure_id", "number"),)

    structure_id: Mapped[UUID] = mapped_column(ForeignKey("structures.id", ondelete="CASCADE"))
    number: Mapped[int]
    length_m: Mapped[float | None]
    width_m: Mapped[float | None]
    thickness_m: Mapped[float | None]
    density_kg_m3: Mapped[float | None]
    laminate: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    material: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    inputs: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    pieces: Mapped[list[dict[str, Any]] | None] = mapped_column(JSONB(none_as_null=True))

    structure: Mapped[Structure] = relationship(back_populates="versions")
