"""Raw curves of coupons."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0007_coupon_curves"
down_revision = "0006_monitoring"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "coupon_curves",
        sa.Column(
            "coupon_id",
            sa.Uuid(),
            sa.ForeignKey("coupons.id", ondelete="CASCADE"),
            primary_key=True,
        ),
        sa.Column("filename", sa.String(), nullable=False),
        sa.Column("file_sha256", sa.LargeBinary(), nullable=False),
        sa.Column("file_size", sa.Integer(), nullable=False),
        sa.Column("request", JSONB(), nullable=False),
        sa.Column("reading", JSONB(), nullable=False),
        sa.Column("reduction", JSONB(), nullable=False),
        sa.Column("software", sa.String(), nullable=False),
        sa.Column("series", JSONB(), nullable=False),
        sa.Column("points", sa.Integer(), nullable=False),
        sa.Column("sha256", sa.LargeBinary(), nullable=False),
        sa.Column("file", sa.LargeBinary(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
    )
    # measured numbers do not compress
    op.execute("ALTER TABLE coupon_curves ALTER COLUMN data SET STORAGE EXTERNAL")


def downgrade() -> None:
    op.drop_table("coupon_curves")
