"""What can be done with structures. Every change of what a structure physically is makes a new version."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from uuid import UUID

from pydantic import ValidationError
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.access import Role, User, audit, project_for
from service.db.clock import transaction_time
from service.problems import Fault, Invalid, NotFound, not_found_as
from service.structures.schemas import Geometry, Laminate, Material, StructureIn, StructureOut, StructurePatch
from service.structures.tables import Structure, StructureVersion


def structure_for(session: Session, user: User, structure_id: UUID, role: Role = "viewer") -> Structure:
    """The structure, if the user has at least this role in its project.

    Raises:
        NotFound: there is none, or it is other people's.
        Forbidden: the user's role is too low.
    """
    structure = session.get(Structure, structure_id)
    if structure is None:
        raise NotFound("structure", structure_id)
    with not_found_as("structure", structure_id):
        project_for(session, user, structure.project_id, role)
    return structure


def current_version(session: Session, structure: Structure) -> StructureVersion:
    """The version that is valid now."""
    return session.scalars(
        select(StructureVersion).where(
            StructureVersion.structure_id == structure.id, StructureVersion.number == structure.version
        )
    ).one()


def create_structure(session: Session, user: User, project_id: UUID, body: StructureIn) -> Structure:
    """A new structure in version 1."""
    project = project_for(session, user, project_id, "editor")
    structure = Structure(project_id=project.id, name=body.name, version=1)
    session.add(structure)
    session.flush()
    _add_version(session, structure, body)
    session.refresh(structure)
    audit(session, user, "structure.create", "structure", structure.id, project.id, name=body.name)
    return structure


def change_structure(session: Session, user: User, structure: Structure, patch: StructurePatch) -> None:
    """Apply a patch: a new name stays in the version, anything physical makes a new one.

    Raises:
        Invalid: the patch, or the structure it would lead to, makes no sense.
    """
    before = describe(session, structure)
    after = _patched(before, patch)
    structure.name = after.name
    physical = ("geometry", "density_kg_m3", "laminate", "material")
    if any(getattr(after, field) != getattr(before, field) for field in physical):
        structure.version += 1
        _add_version(session, structure, after)
    structure.updated_at = transaction_time(session)
    session.flush()
    audit(session, user, "structure.change", "structure", structure.id, structure.project_id, version=structure.version)


def describe(session: Session, structure: Structure) -> StructureOut:
    """The structure in its current version, as clients see it."""
    return _described(structure, current_version(session, structure))


def describe_all(session: Session, structures: Sequence[Structure]) -> list[StructureOut]:
    """Several structures in their current versions."""
    query = (
        select(StructureVersion)
        .join(Structure, Structure.id == StructureVersion.structure_id)
        .where(Structure.id.in_([s.id for s in structures]), StructureVersion.number == Structure.version)
    )
    versions = {version.structure_id: version for version in session.scalars(query)}
    return [_described(structure, versions[structure.id]) for structure in structures]


def _described(structure: Structure, version: StructureVersion) -> StructureOut:
    return StructureOut(
        id=structure.id,
        project_id=structure.project_id,
        name=structure.name,
        version=version.number,
        created_at=structure.created_at,
        updated_at=structure.updated_at,
        **_physical(version),
    )


def describe_version(version: StructureVersion, name: str) -> StructureIn:
    """What a structure was in a version. It was checked when it came in, perhaps by rules of that time."""
    return StructureIn.model_construct(name=name, **_physical(version))


def _physical(version: StructureVersion) -> dict[str, Any]:
    return {
        "geometry": Geometry(length_m=version.length_m, width_m=version.width_m, thickness_m=version.thickness_m),
        "density_kg_m3": version.density_kg_m3,
        "laminate": version.laminate and Laminate.model_validate(version.laminate),
        "material": version.material and Material.model_validate(version.material),
    }


def _patched(before: StructureOut, patch: StructurePatch) -> StructureIn:
    sent = {field: getattr(patch, field) for field in patch.model_fields_set}
    nulls = [field for field, value in sent.items() if value is None]
    if nulls:
        raise Invalid([Fault(f"/{field}", "cannot be null; leave it out to keep it") for field in nulls])
    if "laminate" in sent and "material" in sent:
        raise Invalid("/material", "state a laminate or a material, not both")
    merged = before.model_dump(include=set(StructureIn.model_fields))
    merged.update(patch.model_dump(exclude_unset=True))
    if "laminate" in sent:
        merged["material"] = None
    if "material" in sent:
        merged["laminate"] = None
    try:
        return StructureIn.model_validate(merged)
    except ValidationError as error:
        faults = [Fault("/" + "/".join(map(str, e["loc"])) if e["loc"] else "", e["msg"]) for e in error.errors()]
        raise Invalid(faults) from None


def _add_version(session: Session, structure: Structure, body: StructureIn) -> None:
    session.add(
        StructureVersion(
            structure_id=structure.id,
            number=structure.version,
            **body.geometry.model_dump(),
            density_kg_m3=body.density_kg_m3,
            laminate=body.laminate and body.laminate.model_dump(),
            material=body.material and body.material.model_dump(),
        )
    )
    session.flush()
