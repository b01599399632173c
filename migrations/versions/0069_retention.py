"""Files and time blocks are deleted some days after their import, where a structure says so."""

import sqlalchemy as sa
from alembic import op

revision = "0069_retention"
down_revision = "0068_tracks"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the rule, and when bytes were deleted; until a structure states it, nothing is."""
    op.add_column("structures", sa.Column("retention_days", sa.Integer()))
    for table in ("originals", "imports", "recordings", "records"):
        op.add_column(table, sa.Column("bytes_deleted_at", sa.DateTime(timezone=True)))
    op.alter_column("records", "data", nullable=True)
