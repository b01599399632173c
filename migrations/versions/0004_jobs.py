"""Jobs: versions that watchers follow, losses, the request that asked, fair claims, checkpoints;
priorities.
"""

import sqlalchemy as sa
from alembic import op

revision = "0004_jobs"
down_revision = "0003_updating"
branch_labels = None
depends_on = None

CHANGE_FUNCTION = """
CREATE FUNCTION job_changed() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  IF (NEW.state, NEW.stage, NEW.progress, NEW.message, NEW.attempt, NEW.cancel_requested)
     IS DISTINCT FROM (OLD.state, OLD.stage, OLD.progress, OLD.message, OLD.attempt, OLD.cancel_requested) THEN
    NEW.version := OLD.version + 1;
    PERFORM pg_notify('modalbase_job_changed', NEW.id::text);
    IF NEW.cancel_requested AND NOT OLD.cancel_requested THEN
      PERFORM pg_notify('modalbase_job_cancel', NEW.id::text);
    END IF;
  END IF;
  RETURN NEW;
END $$
"""


def upgrade() -> None:
    op.add_column("jobs", sa.Column("losses", sa.Integer(), server_default="0", nullable=False))
    op.add_column("jobs", sa.Column("request_id", sa.String()))
    op.add_column("jobs", sa.Column("version", sa.Integer(), server_default="0", nullable=False))
    op.create_index("ix_jobs_project_id_started_at", "jobs", ["project_id", "started_at"])
    op.create_index(
        "ix_jobs_queued",
        "jobs",
        ["queue", "project_id", "losses", sa.desc("priority"), "id"],
        postgresql_where=sa.text("state = 'queued'"),
    )
    op.execute(CHANGE_FUNCTION)
    op.execute(
        "CREATE TRIGGER job_changed BEFORE UPDATE ON jobs FOR EACH ROW EXECUTE FUNCTION"
        " job_changed()"
    )
    op.create_table(
        "job_checkpoints",
        sa.Column(
            "job_id", sa.Uuid(), sa.ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True
        ),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column(
            "saved_at", sa.DateTime(timezone=True), server_default=sa.func.now(), nullable=False
        ),
        sa.Column("data", sa.LargeBinary(), nullable=False),
    )
    op.execute("ALTER TABLE job_checkpoints ALTER COLUMN data SET STORAGE EXTERNAL")


def downgrade() -> None:
    op.drop_table("job_checkpoints")
    op.execute("DROP TRIGGER job_changed ON jobs")
    op.execute("DROP FUNCTION job_changed()")
    op.drop_index("ix_jobs_queued")
    op.drop_index("ix_jobs_project_id_started_at")
    for column in ("version", "request_id", "losses"):
        op.drop_column("jobs", column)
