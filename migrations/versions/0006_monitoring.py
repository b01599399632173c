"""Monitors with their series, runs and assessments; alarms and their history; webhooks and
deliveries.
"""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0006_monitoring"
down_revision = "0005_identification"
branch_labels = None
depends_on = None

INSTANT = sa.DateTime(timezone=True)
REAL: sa.Double[float] = sa.Double()
TABLES = (
    "deliveries",
    "webhooks",
    "alarm_events",
    "alarms",
    "monitor_assessments",
    "monitor_runs",
    "monitor_series",
    "monitors",
    "campaign_completions",
)


def identified() -> tuple[sa.Column, sa.Column]:  # type: ignore[type-arg]
    return (
        sa.Column("id", sa.Uuid(), server_default=sa.text("uuidv7()"), primary_key=True),
        sa.Column("created_at", INSTANT, server_default=sa.func.now(), nullable=False),
    )


def refers(
    column: str,
    table: str,
    *,
    nullable: bool = False,
    cascade: bool = False,
    primary_key: bool = False,
) -> sa.Column:  # type: ignore[type-arg]
    key = sa.ForeignKey(f"{table}.id", ondelete="CASCADE" if cascade else None)
    return sa.Column(column, sa.Uuid(), key, nullable=nullable, primary_key=primary_key)


def words(column: str, *, nullable: bool = False, default: str | None = None) -> sa.Column:  # type: ignore[type-arg]
    return sa.Column(column, sa.String(), nullable=nullable, server_default=default)


def upgrade() -> None:
    op.create_table(
        "campaign_completions",
        refers("campaign_id", "campaigns", cascade=True, primary_key=True),
        refers("user_id", "users"),
        sa.Column("completed_at", INSTANT, server_default=sa.func.now(), nullable=False),
    )
    monitors()
    series()
    alarms()
    messages()


def downgrade() -> None:
    for table in TABLES:
        op.drop_table(table)


def monitors() -> None:
    op.create_table(
        "monitors",
        *identified(),
        refers("structure_id", "structures", cascade=True),
        refers("structure_version_id", "structure_versions"),
        refers("user_id", "users"),
        words("name"),
        words("boundary", nullable=True),
        sa.Column("recipe", JSONB(), nullable=False),
        words("modes"),
        words("priors"),
        sa.Column("watch", JSONB(), nullable=False),
        sa.Column("since", INSTANT),
        sa.Column("expected_interval_days", REAL),
        words("runs_on"),
        words("schedule", nullable=True),
        sa.Column("next_run_at", INSTANT),
        sa.Column("mail_to", JSONB(), nullable=False),
        sa.Column("active", sa.Boolean(), server_default=sa.text("true"), nullable=False),
        sa.Column("series", sa.Integer(), server_default="0", nullable=False),
        words("state", default="no data"),
        sa.Column("state_rank", sa.Integer(), nullable=False),
        sa.Column("state_since", INSTANT, server_default=sa.func.now(), nullable=False),
        sa.Column("updated_at", INSTANT, server_default=sa.func.now(), nullable=False),
        sa.CheckConstraint(
            "state IN ('no data', 'normal', 'pending', 'alarm', 'acknowledged')", "state"
        ),
    )
    op.create_index(None, "monitors", ["structure_id", "id"])
    op.create_index(None, "monitors", ["state_rank", "id"])


def series() -> None:
    op.create_table(
        "monitor_series",
        *identified(),
        refers("monitor_id", "monitors", cascade=True),
        sa.Column("number", sa.Integer(), nullable=False),
        words("software"),
        words("reason"),
        words("digest", nullable=True),
        sa.Column("assessed_at", INSTANT),
        sa.Column("document", sa.JSON()),
        sa.UniqueConstraint("monitor_id", "number"),
    )
    op.create_table(
        "monitor_runs",
        *identified(),
        refers("series_id", "monitor_series", cascade=True),
        refers("campaign_id", "campaigns", cascade=True),
        sa.Column("revision", sa.Integer(), nullable=False),
        words("fingerprint"),
        words("state"),
        words("message", nullable=True),
        refers("update_job_id", "update_jobs", nullable=True),
        words("software", nullable=True),
        sa.Column("values", JSONB()),
        sa.Column("finished_at", INSTANT),
        sa.UniqueConstraint("series_id", "campaign_id", "revision"),
        sa.CheckConstraint("state IN ('running', 'succeeded', 'failed', 'refused')", "state"),
    )
    running = sa.text("state = 'running'")
    op.create_index(
        "ix_monitor_runs_running", "monitor_runs", ["update_job_id"], postgresql_where=running
    )
    op.create_table(
        "monitor_assessments",
        refers("id", "jobs", primary_key=True),
        refers("series_id", "monitor_series", cascade=True),
        words("digest"),
    )
    op.create_index(None, "monitor_assessments", ["series_id", "id"])


def alarms() -> None:
    op.create_table(
        "alarms",
        *identified(),
        refers("monitor_id", "monitors", cascade=True),
        words("parameter"),
        refers("campaign_id", "campaigns", cascade=True),
        sa.Column("series", sa.Integer(), nullable=False),
        words("state"),
        sa.Column("acknowledged_at", INSTANT),
        refers("acknowledged_by", "users", nullable=True),
        words("note", nullable=True),
        sa.Column("details", JSONB(), nullable=False),
        sa.CheckConstraint("state IN ('alarm', 'acknowledged', 'cleared', 'withdrawn')", "state"),
    )
    op.create_index(None, "alarms", ["monitor_id", "id"])
    op.create_index(
        "ix_alarms_raised_once",
        "alarms",
        ["monitor_id", "parameter", "campaign_id"],
        unique=True,
        postgresql_where=sa.text("state <> 'withdrawn'"),
    )
    op.create_table(
        "alarm_events",
        *identified(),
        refers("alarm_id", "alarms", cascade=True),
        words("event"),
        refers("user_id", "users", nullable=True),
        words("note"),
    )
    op.create_index(None, "alarm_events", ["alarm_id", "id"])


def messages() -> None:
    op.create_table(
        "webhooks",
        *identified(),
        refers("project_id", "projects", cascade=True),
        words("url"),
        words("secret"),
        sa.Column("events", JSONB(), nullable=False),
        sa.Column("active", sa.Boolean(), server_default=sa.text("true"), nullable=False),
    )
    op.create_index(None, "webhooks", ["project_id", "id"])
    op.create_table(
        "deliveries",
        *identified(),
        refers("project_id", "projects", cascade=True),
        refers("monitor_id", "monitors", nullable=True, cascade=True),
        refers("webhook_id", "webhooks", nullable=True, cascade=True),
        words("recipient", nullable=True),
        words("message_id"),
        words("event"),
        words("body"),
        words("state", default="waiting"),
        sa.Column("attempts", sa.Integer(), server_default="0", nullable=False),
        sa.Column("due_at", INSTANT, server_default=sa.func.now(), nullable=False),
        sa.Column("last_status", sa.Integer()),
        words("last_error", nullable=True),
        sa.Column("delivered_at", INSTANT),
        sa.CheckConstraint("state IN ('waiting', 'delivered', 'failed')", "state"),
        sa.CheckConstraint("(webhook_id IS NULL) = (recipient IS NOT NULL)", "receiver"),
    )
    op.create_index(None, "deliveries", ["webhook_id", "id"])
    op.create_index(None, "deliveries", ["monitor_id", "id"])
    waiting = sa.text("state = 'waiting'")
    op.create_index("ix_deliveries_due", "deliveries", ["due_at"], postgresql_where=waiting)
