"""Structures can be bodies in space, by their shape."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0028_shapes"
down_revision = "0027_hit_decisions"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """A column, empty where a structure is a strip or plate."""
    op.add_column("structure_versions", sa.Column("shape", JSONB(none_as_null=True), nullable=True))


def downgrade() -> None:
    """Forget them."""
    op.drop_column("structure_versions", "shape")
