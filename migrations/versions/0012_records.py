"""Time blocks of hammer tests, their processings, and what an FRF knows of the one that made it."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0012_records"
down_revision = "0011_keys_and_people"
branch_labels = None
depends_on = None

HIT = ["campaign_id", "force_point", "force_direction", "hit", "quantity", "point", "direction"]


def upgrade() -> None:
    op.create_table(
        "records",
        sa.Column("id", sa.Uuid(), server_default=sa.text("uuidv7()"), primary_key=True),
        sa.Column(
            "created_at", sa.DateTime(timezone=True), server_default=sa.func.now(), nullable=False
        ),
        sa.Column(
            "campaign_id",
            sa.Uuid(),
            sa.ForeignKey("campaigns.id", ondelete="CASCADE"),
            nullable=False,
        ),
        sa.Column("label", sa.String(), nullable=False),
        sa.Column("filename", sa.String(), nullable=False),
        sa.Column("quantity", sa.String(), nullable=False),
        sa.Column("point", sa.BigInteger(), nullable=False),
        sa.Column("direction", sa.Integer(), nullable=False),
        sa.Column("force_point", sa.BigInteger(), nullable=False),
        sa.Column("force_direction", sa.Integer(), nullable=False),
        sa.Column("hit", sa.BigInteger(), nullable=False),
        sa.Column("sample_rate_hz", sa.Float(), nullable=False),
        sa.Column("samples", sa.Integer(), nullable=False),
        sa.Column("sensitivity", sa.Float(), nullable=False),
        sa.Column("window_rate_per_s", sa.Float(), nullable=False),
        sa.Column("full_scale", sa.Float()),
        sa.Column("dtype", sa.String(), nullable=False),
        sa.Column("sha256", sa.LargeBinary(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
    )
    # measured numbers do not compress
    op.execute("ALTER TABLE records ALTER COLUMN data SET STORAGE EXTERNAL")
    op.create_index(None, "records", ["campaign_id", "id"])
    op.create_index("ix_records_hit", "records", HIT, unique=True)
    op.create_table(
        "processings",
        sa.Column("id", sa.Uuid(), sa.ForeignKey("jobs.id"), primary_key=True),
        sa.Column(
            "campaign_id",
            sa.Uuid(),
            sa.ForeignKey("campaigns.id", ondelete="CASCADE"),
            nullable=False,
        ),
        sa.Column("options", JSONB(), nullable=False),
        sa.Column("document", sa.JSON(none_as_null=True)),
    )
    op.create_index(None, "processings", ["campaign_id", "id"])
    op.add_column("frfs", sa.Column("processing_id", sa.Uuid(), sa.ForeignKey("processings.id")))
    op.add_column("frfs", sa.Column("window_rate_per_s", sa.Float()))
    op.add_column("frfs", sa.Column("variance_sha256", sa.LargeBinary()))
    op.add_column("frfs", sa.Column("variance", sa.LargeBinary()))
    op.execute("ALTER TABLE frfs ALTER COLUMN variance SET STORAGE EXTERNAL")
    op.create_index(None, "frfs", ["processing_id"])


def downgrade() -> None:
    op.drop_index("ix_frfs_processing_id")
    for name in ("variance", "variance_sha256", "window_rate_per_s", "processing_id"):
        op.drop_column("frfs", name)
    op.drop_table("processings")
    op.drop_table("records")
