"""Structures and campaigns state how well they know what they hand in."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0019_inputs"
down_revision = "0018_joint_updates"
branch_labels = None
depends_on = None

_TABLES = ("structure_versions", "campaigns")


def upgrade() -> None:
    """One column each, empty where nothing is stated."""
    for table in _TABLES:
        op.add_column(table, sa.Column("inputs", JSONB(none_as_null=True), nullable=True))


def downgrade() -> None:
    """Forget them."""
    for table in _TABLES:
        op.drop_column(table, "inputs")
