"""Update jobs and their results."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0003_updating"
down_revision = "0002_measurements"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "update_jobs",
        sa.Column("id", sa.Uuid(), sa.ForeignKey("jobs.id"), primary_key=True),
        sa.Column(
            "project_id",
            sa.Uuid(),
            sa.ForeignKey("projects.id", ondelete="CASCADE"),
            nullable=False,
        ),
        sa.Column(
            "campaign_id",
            sa.Uuid(),
            sa.ForeignKey("campaigns.id", ondelete="CASCADE"),
            nullable=False,
        ),
        sa.Column(
            "structure_version_id",
            sa.Uuid(),
            sa.ForeignKey("structure_versions.id"),
            nullable=False,
        ),
        sa.Column("recipe", JSONB(), nullable=False),
        sa.Column("idempotency_key", sa.String()),
    )
    op.create_index(None, "update_jobs", ["campaign_id", "id"])
    op.create_index(None, "update_jobs", ["project_id", "idempotency_key"], unique=True)
    op.create_table(
        "update_results",
        sa.Column(
            "id", sa.Uuid(), sa.ForeignKey("update_jobs.id", ondelete="CASCADE"), primary_key=True
        ),
        sa.Column(
            "created_at", sa.DateTime(timezone=True), server_default=sa.func.now(), nullable=False
        ),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("prediction", sa.LargeBinary(), nullable=False),
    )
    op.execute("ALTER TABLE update_results ALTER COLUMN prediction SET STORAGE EXTERNAL")


def downgrade() -> None:
    op.drop_table("update_results")
    op.drop_table("update_jobs")
