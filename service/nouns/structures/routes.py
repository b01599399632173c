"""Routes of structures."""

from uuid import UUID

from sqlalchemy import select

from service.nouns.structures import operations
from service.nouns.structures.operations import StructureVersion
from service.nouns.structures.schemas import StructureIn, StructureOut, StructurePatch
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.access.nouns import NounRoutes
from service.platform.errors import NotFound

router = api_router(tags=["structures"])
nouns = NounRoutes(
    router,
    operations.structure_for,
    StructureOut,
    operations.describe_all,
    "structures",
    "structure_id",
)


nouns.creating(
    "create_structure",
    "Describe a structure: geometry, density and either plies or a homogenised material, nominal"
    " values.",
    StructureIn,
    operations.create_structure,
    tagged=True,
    measured=True,
)
nouns.listing("list_structures", "Structures of a project.", hides=True)
nouns.getting("get_structure", "A structure in its current version.", tagged=True)


@router.get("/structures/{structure_id}/versions/{number}")
def get_structure_version(
    structure_id: UUID, number: int, session: SessionDep, user: CurrentUser
) -> StructureIn:
    """What a structure was in an earlier version; results refer to it by number."""
    structure = operations.structure_for(session, user, structure_id)
    if not 1 <= number <= structure.version:
        raise NotFound("version", number)
    version = session.scalars(
        select(StructureVersion).where(
            StructureVersion.structure_id == structure.id, StructureVersion.number == number
        )
    ).one()
    return operations.describe_version(version, structure.name)


nouns.changing(
    "change_structure",
    "Change a structure. Geometry, density or section make a new version; what a result used stays"
    " as it was.",
    StructurePatch,
    operations.change_structure,
    measured=True,
)
nouns.deleting(
    "delete_structure",
    "Hide a structure with its campaigns and monitors. It stays stored and can be restored.",
)
nouns.restoring("restore_structure", "Bring a deleted structure back.")
