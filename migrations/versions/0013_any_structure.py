"""A structure may be any body: geometry and density are what an update needs, an identification
does without.
"""

from alembic import op

revision = "0013_any_structure"
down_revision = "0012_records"
branch_labels = None
depends_on = None

_COLUMNS = ("length_m", "width_m", "thickness_m", "density_kg_m3")


def upgrade() -> None:
    """Let the columns be empty."""
    for column in _COLUMNS:
        op.alter_column("structure_versions", column, nullable=True)


def downgrade() -> None:
    """Refuse emptiness again; versions without a geometry stop it, for none can be made up."""
    for column in _COLUMNS:
        op.alter_column("structure_versions", column, nullable=False)
