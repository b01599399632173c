"""Structures: a row a structure and a row a version that never changes, and what can be done with
them.

Every change of what a structure physically is makes a new version.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import (
    JSON,
    ForeignKey,
    Index,
    LargeBinary,
    Select,
    UniqueConstraint,
    and_,
    func,
    or_,
    select,
    text,
)
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, Session, mapped_column, relationship

from service.nouns.structures.schemas import (
    Geometry,
    Laminate,
    Material,
    Piece,
    StructureIn,
    StructureInputs,
    StructureOut,
    StructurePatch,
)
from service.nouns.structures.shapes import Shape
from service.platform.access import Lookup, User, project_for, projects_at_work, projects_of
from service.platform.access.metadata_schema import require_metadata
from service.platform.db.base import Base, Identified, Labelled, label_indexes, transaction_time
from service.platform.errors import Fault, Invalid
from service.platform.web import shown_as
from service.platform.web.json_body import checked

WORDS = "to_tsvector('simple'::regconfig, name)"
"""What a free search reads of a structure."""


class Structure(Identified, Labelled, Base):
    """A structure; what it physically is stands in its versions."""

    __tablename__ = "structures"
    __table_args__ = (
        Index(None, "project_id", "id"),
        Index("ix_structures_words", text(WORDS), postgresql_using="gin"),
        *label_indexes("structures"),
    )

    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    name: Mapped[str]
    version: Mapped[int] = mapped_column(default=1)
    retention_days: Mapped[int | None]
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
    shape: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    model: Mapped[UUID | None] = mapped_column(ForeignKey("structure_models.id", deferrable=True))

    structure: Mapped[Structure] = relationship(back_populates="versions")


class StructureModel(Base):
    """A model that a user sent: a deck, what was read of it, and its arrays in SI. Its key is its
    job's, and so is its status.
    """

    __tablename__ = "structure_models"
    __table_args__ = (Index(None, "structure_id", "id"),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    structure_id: Mapped[UUID] = mapped_column(ForeignKey("structures.id", ondelete="CASCADE"))
    filename: Mapped[str]
    sha256: Mapped[bytes] = mapped_column(ForeignKey("originals.sha256"))
    units: Mapped[str | None]
    accepted: Mapped[list[Any]]
    sections: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    arrays: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    arrays_sha256: Mapped[bytes | None]


structure_for = Lookup(Structure, "structure", "project_id")
structures_of = structure_for.rows


def retention_rules(session: Session) -> Sequence[tuple[UUID, int]]:
    """The structures that have a retention rule, each with its days; none that is archived or
    deleted.
    """
    query = select(Structure.id, Structure.retention_days).where(
        Structure.retention_days.is_not(None),
        Structure.deleted_at.is_(None),
        Structure.project_id.in_(projects_at_work()),
    )
    return [(key, days) for key, days in session.execute(query) if days is not None]


def current_version(session: Session, structure: Structure) -> StructureVersion:
    """The version of a structure that is valid now, which new campaigns and new updates refer
    to.
    """
    return session.scalars(
        select(StructureVersion).where(
            StructureVersion.structure_id == structure.id,
            StructureVersion.number == structure.version,
        )
    ).one()


def create_structure(
    session: Session, user: User, project_id: UUID, body: StructureIn
) -> Structure:
    """Store a new structure in version 1 and note it in the audit trail."""
    project = project_for(session, user, project_id, "editor")
    require_metadata(session, project.id, "structure", body.model_dump(mode="json"))
    structure = Structure(
        project_id=project.id,
        name=body.name,
        version=1,
        retention_days=body.retention_days,
        tags=body.tags,
        meta=body.meta,
    )
    session.add(structure)
    session.flush()
    _add_version(session, structure, body)
    session.refresh(structure)
    structure_for.note(session, user, structure, "create", name=body.name)
    return structure


def change_structure(
    session: Session, user: User, structure: Structure, patch: StructurePatch
) -> None:
    """Apply a patch to a locked structure. A new name stays in the version; a change of geometry,
    density, laminate, material or inputs makes the next one.

    Results that were computed keep the version that they were computed with.

    Raises:
        Invalid: the patch, or the structure it would lead to, makes no sense.
    """
    before = describe(session, structure)
    after = _patched(before, patch)
    require_metadata(session, structure.project_id, "structure", after.model_dump(mode="json"))
    structure.name, structure.tags, structure.meta = after.name, after.tags, after.meta
    structure.retention_days = after.retention_days
    physical = (
        "geometry",
        "density_kg_m3",
        "laminate",
        "material",
        "inputs",
        "pieces",
        "shape",
        "model",
    )
    if any(getattr(after, field) != getattr(before, field) for field in physical):
        structure.version += 1
        _add_version(session, structure, after)
    structure.updated_at = transaction_time(session)
    session.flush()
    days = {"retention_days": after.retention_days}
    ruled = days if before.retention_days != after.retention_days else {}
    structure_for.note(session, user, structure, "change", version=structure.version, **ruled)


def describe(session: Session, structure: Structure) -> StructureOut:
    """The structure in its current version, as clients see it: one query, for the version and the
    one before.
    """
    return describe_all(session, [structure])[0]


def describe_all(session: Session, structures: Sequence[Structure]) -> list[StructureOut]:
    """Several structures in their current versions, as clients see them, in the order given; one
    query for all versions.
    """
    query = (
        select(StructureVersion)
        .join(Structure, Structure.id == StructureVersion.structure_id)
        .where(
            Structure.id.in_([s.id for s in structures]),
            StructureVersion.number.in_([Structure.version, Structure.version - 1]),
        )
    )
    versions = {
        (version.structure_id, version.number): version for version in session.scalars(query)
    }
    return [
        _described(s, versions[s.id, s.version], versions.get((s.id, s.version - 1)))
        for s in structures
    ]


def _described(
    structure: Structure, version: StructureVersion, before: StructureVersion | None
) -> StructureOut:
    now, then = _physical(version), {} if before is None else _physical(before)
    replaced = [name for name in _BODIES if then.get(name) and not now[name]]
    return shown_as(StructureOut, structure, **now, replaced=replaced)


def was_another(session: Session, structure_id: UUID) -> bool:
    """Whether an earlier version of a structure says what it was; a structure is often empty until
    its deck is read.
    """
    version = StructureVersion
    bodies = (version.length_m, *(getattr(version, name) for name in _BODIES if name != "geometry"))
    earlier = (
        select(version.id)
        .join(Structure, Structure.id == version.structure_id)
        .where(
            Structure.id == structure_id,
            version.number < Structure.version,
            or_(*(column.is_not(None) for column in bodies)),
        )
    )
    return session.scalar(select(earlier.exists())) or False


def describe_version(version: StructureVersion, name: str) -> StructureIn:
    """A structure as it was in a version, in the form of a request.

    It was checked when it came in, perhaps by rules of that time, so it is not checked again: an
    old result must stay readable.

    Args:
        version: the stored version.
        name: the structure's name now; versions have none.
    """
    return StructureIn.model_construct(name=name, **_physical(version))


def _physical(version: StructureVersion) -> dict[str, Any]:
    pieces = (
        None
        if version.pieces is None
        else [Piece.model_validate(piece) for piece in version.pieces]
    )
    sizes = {
        "length_m": version.length_m,
        "width_m": version.width_m,
        "thickness_m": version.thickness_m,
    }
    return {
        "geometry": None if None in sizes.values() else Geometry.model_validate(sizes),
        "density_kg_m3": version.density_kg_m3,
        "laminate": version.laminate and Laminate.model_validate(version.laminate),
        "material": version.material and Material.model_validate(version.material),
        "inputs": version.inputs and StructureInputs.model_validate(version.inputs),
        "pieces": pieces,
        "shape": version.shape and Shape.model_validate(version.shape),
        "model": version.model,
    }


def _patched(before: StructureOut, patch: StructurePatch) -> StructureIn:
    sent = {field: getattr(patch, field) for field in patch.model_fields_set}
    nulls = [name for name, value in sent.items() if value is None and name != "retention_days"]
    if nulls:
        raise Invalid(
            [Fault(f"/{field}", "cannot be null; leave it out to keep it") for field in nulls]
        )
    if "laminate" in sent and "material" in sent:
        raise Invalid("/material", "state a laminate or a material, not both")
    merged = before.model_dump(include=set(StructureIn.model_fields))
    merged.update(patch.model_dump(exclude_unset=True))
    replaced = [
        name
        for member, others in _INSTEAD.items()
        if member in sent
        for name in others
        if name not in sent
    ]
    return checked(StructureIn, merged | dict.fromkeys(replaced))


_BODIES = ("geometry", "laminate", "material", "pieces", "shape", "model")
_INSTEAD = {
    "laminate": ("material",),
    "material": ("laminate",),
    "geometry": ("shape", "model"),
    **{name: tuple(other for other in _BODIES if other != name) for name in ("shape", "model")},
}
"""What a member takes the place of."""


def _require_inputs(body: StructureIn) -> None:
    """Refuse standard deviations of what the body has not.

    Raises:
        Invalid: each of them.
    """
    lacks = {}
    if body.geometry is not None:
        lacks["height_sd_m"] = "is of a body in space; a strip or plate has thickness_sd_m"
        if body.laminate is None:
            lacks["ply_angle_sd_deg"] = (
                "is of the plies of a laminate; a material has fibre_angle_sd_deg"
            )
    faults = [
        Fault(f"/inputs/{name}", why)
        for name, why in lacks.items()
        if getattr(body.inputs, name, None) is not None
    ]
    if faults:
        raise Invalid(faults)


def _add_version(session: Session, structure: Structure, body: StructureIn) -> None:
    _require_inputs(body)
    session.add(
        StructureVersion(
            structure_id=structure.id,
            number=structure.version,
            **(body.geometry.model_dump() if body.geometry else {}),
            density_kg_m3=body.density_kg_m3,
            laminate=body.laminate and body.laminate.model_dump(),
            material=body.material and body.material.model_dump(),
            inputs=body.inputs and body.inputs.model_dump(),
            pieces=[piece.model_dump() for piece in body.pieces] if body.pieces else None,
            shape=body.shape and body.shape.model_dump(exclude_none=True),
            model=_known_model(session, structure, body.model),
        )
    )
    session.flush()


def _known_model(session: Session, structure: Structure, key: UUID | None) -> UUID | None:
    """The key of a model of the structure that was read.

    Raises:
        Invalid: there is none of this key.
    """
    if key is None:
        return None
    known = select(StructureModel.id).where(
        StructureModel.id == key,
        StructureModel.structure_id == structure.id,
        StructureModel.arrays.is_not(None),
    )
    if session.scalars(known).one_or_none() is None:
        raise Invalid(
            "/model",
            f"{key} is no model that was read for this structure; POST /structures/{{id}}/model"
            " sends one",
        )
    return key


def take_model(session: Session, structure_id: UUID, key: UUID) -> int:
    """Make a structure's next version, which is this model, and return its number; what it was
    before is in the version before.

    The caller has the structure's row locked.
    """
    structure = session.get_one(
        Structure, structure_id, with_for_update=True, populate_existing=True
    )
    before = describe(session, structure)
    structure.version += 1
    _add_version(
        session,
        structure,
        checked(StructureIn, {"name": structure.name, "model": key, "inputs": before.inputs}),
    )
    structure.updated_at = transaction_time(session)
    return structure.version


def present_structure(session: Session, structure_id: UUID) -> tuple[StructureVersion, StructureIn]:
    """A structure's present version, and what the structure is in it."""
    structure = session.get_one(Structure, structure_id)
    version = current_version(session, structure)
    return version, describe_version(version, structure.name)


def structure_of(session: Session, structure_id: UUID) -> Structure:
    """The row of a structure as it is now, whoever asks."""
    return session.get_one(Structure, structure_id, populate_existing=True)


def version_of(session: Session, version_id: UUID) -> StructureVersion:
    """The row of a version, whoever asks."""
    return session.get_one(StructureVersion, version_id)


def structures_to_choose(session: Session, user: User) -> list[tuple[UUID, UUID, str, bool]]:
    """Project, key and name of all structures that somebody sees, by name, and whether they state a
    material.
    """
    version = StructureVersion
    of_material = or_(version.material.is_not(None), version.shape.has_key("material"))
    query = (
        select(Structure.project_id, Structure.id, Structure.name, of_material)
        .join(
            version,
            and_(version.structure_id == Structure.id, version.number == Structure.version),
        )
        .where(Structure.id.in_(structures_in(projects_of(user))))
    )
    return [
        (project, key, name, bool(of))
        for project, key, name, of in session.execute(query.order_by(Structure.name, Structure.id))
    ]


def structures_in(projects: Select[UUID] | Sequence[UUID]) -> Select[UUID]:
    """Keys of the structures of some projects that are not deleted, as part of a query."""
    return select(Structure.id).where(
        Structure.project_id.in_(projects), Structure.deleted_at.is_(None)
    )
