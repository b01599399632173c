"""Identification jobs."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0005_identification"
down_revision = "0004_jobs"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "identifications",
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
    op.create_index(None, "identifications", ["campaign_id", "id"])


def downgrade() -> None:
    op.drop_table("identifications")
