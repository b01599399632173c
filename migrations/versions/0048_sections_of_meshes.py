"""Sections that a user states of the sets of a mesh."""

import sqlalchemy as sa
from alembic import op

revision = "0048_sections_of_meshes"
down_revision = "0047_seen_windows"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the column."""
    op.add_column("structure_models", sa.Column("sections", sa.JSON(), nullable=True))


def downgrade() -> None:
    """Drop it; meshes that were read stay readable as they were kept."""
    op.drop_column("structure_models", "sections")
