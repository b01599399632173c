"""Monitors of modes, which have no update, and covariates of campaigns by name."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0061_modes"
down_revision = "0060_recordings"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add what a monitor watches, the job of a run of modes, and a campaign's covariates."""
    op.add_column(
        "campaigns",
        sa.Column("covariates", JSONB(), nullable=False, server_default=sa.text("'{}'")),
    )
    op.add_column(
        "monitors", sa.Column("watches", sa.String(), nullable=False, server_default="update")
    )
    op.create_check_constraint("watches", "monitors", "watches IN ('update', 'modes')")
    op.add_column("monitor_runs", sa.Column("job_id", sa.Uuid()))
    op.create_foreign_key(
        op.f("fk_monitor_runs_job_id_jobs"),
        "monitor_runs",
        "jobs",
        ["job_id"],
        ["id"],
        ondelete="SET NULL",
    )
    op.create_index(
        "ix_monitor_runs_of_modes_running",
        "monitor_runs",
        ["job_id"],
        postgresql_where=sa.text("state = 'running'"),
    )
