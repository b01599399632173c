"""Monitors that are deleted: hidden, and brought back."""

import sqlalchemy as sa
from alembic import op

revision = "0008_deleted_monitors"
down_revision = "0007_coupon_curves"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("monitors", sa.Column("deleted_at", sa.DateTime(timezone=True)))


def downgrade() -> None:
    op.drop_column("monitors", "deleted_at")
