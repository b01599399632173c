"""Administrators: users who may look after other users by REST. Nobody is one until the operator
says so.
"""

import sqlalchemy as sa
from alembic import op

revision = "0021_administrators"
down_revision = "0020_storage"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """One column."""
    op.add_column(
        "users",
        sa.Column("administrator", sa.Boolean, server_default=sa.text("false"), nullable=False),
    )


def downgrade() -> None:
    """Forget them."""
    op.drop_column("users", "administrator")
