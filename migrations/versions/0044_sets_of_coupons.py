"""The sets of a body in space that a batch of coupons is of."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0044_sets_of_coupons"
down_revision = "0043_trace_lines"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Batches of before name none: they are of the whole body's material."""
    op.add_column(
        "coupon_batches", sa.Column("sets", postgresql.JSONB(), nullable=False, server_default="[]")
    )
    op.alter_column("coupon_batches", "sets", server_default=None)


def downgrade() -> None:
    """Forget them."""
    op.drop_column("coupon_batches", "sets")
