"""Structures state steps and tapers of their thickness."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0024_pieces"
down_revision = "0021_administrators"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """A column, empty where a structure is of one thickness."""
    op.add_column(
        "structure_versions", sa.Column("pieces", JSONB(none_as_null=True), nullable=True)
    )


def downgrade() -> None:
    """Forget them."""
    op.drop_column("structure_versions", "pieces")
