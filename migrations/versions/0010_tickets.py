"""Jobs: the ticket of the engine that runs each, which its heartbeats watch over in place of leases
of our own.
"""

import sqlalchemy as sa
from alembic import op

revision = "0010_tickets"
down_revision = "0009_original_rows"
branch_labels = None
depends_on = None

CHANGE_FUNCTION = """
CREATE OR REPLACE FUNCTION job_changed() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  IF (NEW.state, NEW.stage, NEW.progress, NEW.message, NEW.attempt, NEW.cancel_requested)
     IS DISTINCT FROM (OLD.state, OLD.stage, OLD.progress, OLD.message, OLD.attempt, OLD.cancel_requested) THEN
    NEW.version := OLD.version + 1;
    PERFORM pg_notify('modalbase_job_changed', NEW.id::text);
    {cancelling}
  END IF;
  RETURN NEW;
END $$
"""
CANCELLING = """
    IF NEW.cancel_requested AND NOT OLD.cancel_requested THEN
      PERFORM pg_notify('modalbase_job_cancel', NEW.id::text);
    END IF;
"""
WAIT_AGAIN = """
UPDATE jobs SET state = 'queued', worker = NULL, stage = NULL, progress = 0, queued_at = now(),
  message = 'the service was upgraded; queued again' WHERE state = 'running'
"""
NEW_TICKETS = """
WITH made AS (
  INSERT INTO procrastinate_jobs (queue_name, task_name, args)
  SELECT queue, 'modalbase.run', jsonb_build_object('job_id', id) FROM jobs WHERE state = 'queued' ORDER BY id
  RETURNING id, args
)
UPDATE jobs SET ticket = made.id FROM made WHERE jobs.id = cast(made.args->>'job_id' AS uuid)
"""

DELETE_FUNCTION = """
CREATE FUNCTION job_deleted() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  DELETE FROM procrastinate_jobs WHERE id = OLD.ticket;
  RETURN NULL;
END $$
"""


def upgrade() -> None:
    op.add_column("jobs", sa.Column("ticket", sa.BigInteger()))
    op.execute("DELETE FROM procrastinate_jobs WHERE task_name = 'modalbase.run'")
    op.execute(WAIT_AGAIN)
    op.execute(NEW_TICKETS)
    op.drop_index("ix_jobs_running_lease_until")
    op.drop_column("jobs", "lease_until")
    op.create_index(
        "ix_jobs_running_project_id",
        "jobs",
        ["project_id"],
        postgresql_where=sa.text("state = 'running'"),
    )
    op.execute(CHANGE_FUNCTION.format(cancelling=""))
    op.execute(DELETE_FUNCTION)
    op.execute(
        "CREATE TRIGGER job_deleted AFTER DELETE ON jobs FOR EACH ROW EXECUTE FUNCTION"
        " job_deleted()"
    )


def downgrade() -> None:
    op.execute("DROP TRIGGER job_deleted ON jobs")
    op.execute("DROP FUNCTION job_deleted()")
    op.execute(CHANGE_FUNCTION.format(cancelling=CANCELLING))
    op.drop_index("ix_jobs_running_project_id")
    op.add_column("jobs", sa.Column("lease_until", sa.DateTime(timezone=True)))
    op.create_index(
        "ix_jobs_running_lease_until",
        "jobs",
        ["lease_until"],
        postgresql_where=sa.text("state = 'running'"),
    )
    op.drop_column("jobs", "ticket")
