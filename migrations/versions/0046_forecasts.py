"""Forecasts: a structure's nominal model, solved before anything is measured."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0046_forecasts"
down_revision = "0045_instruments"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the table."""
    op.create_table(
        "forecasts",
        sa.Column("id", sa.Uuid(), nullable=False),
        sa.Column("structure_id", sa.Uuid(), nullable=False),
        sa.Column("structure_version_id", sa.Uuid(), nullable=False),
        sa.Column("request", postgresql.JSONB(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=True),
        sa.Column("arrays", sa.LargeBinary(), nullable=True),
        sa.ForeignKeyConstraint(["id"], ["jobs.id"], name="fk_forecasts_id_jobs", deferrable=True),
        sa.ForeignKeyConstraint(
            ["structure_id"],
            ["structures.id"],
            name="fk_forecasts_structure_id_structures",
            ondelete="CASCADE",
        ),
        sa.ForeignKeyConstraint(
            ["structure_version_id"],
            ["structure_versions.id"],
            name="fk_forecasts_structure_version_id_structure_versions",
            deferrable=True,
        ),
        sa.PrimaryKeyConstraint("id", name="pk_forecasts"),
    )
    op.create_index("ix_forecasts_structure_id_id", "forecasts", ["structure_id", "id"])
    op.execute("ALTER TABLE forecasts ALTER COLUMN arrays SET STORAGE EXTERNAL")


def downgrade() -> None:
    """Drop it, and with it what was found."""
    op.drop_table("forecasts")
