"""Users, keys, projects, members, audit trail, jobs, and the queue's own schema."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

from migrations import procrastinate_schema

revision = "0001_foundations"
down_revision = None
branch_labels = None
depends_on = None

INSTANT = sa.DateTime(timezone=True)


def identified() -> tuple[sa.Column, sa.Column]:  # type: ignore[type-arg]
    return (
        sa.Column("id", sa.Uuid(), server_default=sa.text("uuidv7()"), primary_key=True),
        sa.Column("created_at", INSTANT, server_default=sa.func.now(), nullable=False),
    )


def upgrade() -> None:
    access()
    audit()
    jobs()
    procrastinate_schema.apply(op.get_bind(), procrastinate_schema.FIRST)


def access() -> None:
    op.create_table(
        "users", *identified(), sa.Column("name", sa.String(), nullable=False, unique=True)
    )
    op.create_table(
        "api_keys",
        *identified(),
        sa.Column(
            "user_id",
            sa.Uuid(),
            sa.ForeignKey("users.id", ondelete="CASCADE"),
            nullable=False,
            index=True,
        ),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("prefix", sa.String(), nullable=False, unique=True),
        sa.Column("secret_sha256", sa.LargeBinary(), nullable=False),
        sa.Column("last_used_at", INSTANT),
        sa.Column("revoked_at", INSTANT),
    )
    op.create_table(
        "projects",
        *identified(),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("description", sa.String(), server_default="", nullable=False),
    )
    op.create_table(
        "members",
        sa.Column(
            "project_id",
            sa.Uuid(),
            sa.ForeignKey("projects.id", ondelete="CASCADE"),
            primary_key=True,
        ),
        sa.Column(
            "user_id",
            sa.Uuid(),
            sa.ForeignKey("users.id", ondelete="CASCADE"),
            primary_key=True,
            index=True,
        ),
        sa.Column("role", sa.String(), nullable=False),
        sa.CheckConstraint("role IN ('viewer', 'editor', 'owner')", "role"),
    )


def audit() -> None:
    op.create_table(
        "audit_events",
        *identified(),
        sa.Column("user_id", sa.Uuid(), sa.ForeignKey("users.id", ondelete="SET NULL")),
        sa.Column("project_id", sa.Uuid(), sa.ForeignKey("projects.id", ondelete="SET NULL")),
        sa.Column("action", sa.String(), nullable=False),
        sa.Column("subject_type", sa.String(), nullable=False),
        sa.Column("subject_id", sa.Uuid()),
        sa.Column("detail", JSONB(), nullable=False),
        sa.Column("request_id", sa.String()),
        sa.Index("ix_audit_events_project_id_id", "project_id", "id"),
        sa.Index("ix_audit_events_user_id_id", "user_id", "id"),
    )


def jobs() -> None:
    op.create_table(
        "jobs",
        *identified(),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column(
            "project_id",
            sa.Uuid(),
            sa.ForeignKey("projects.id", ondelete="CASCADE"),
            nullable=False,
        ),
        sa.Column("queue", sa.String(), nullable=False),
        sa.Column("state", sa.String(), server_default="queued", nullable=False),
        sa.Column("priority", sa.Integer(), server_default="0", nullable=False),
        sa.Column("attempt", sa.Integer(), server_default="0", nullable=False),
        sa.Column("max_attempts", sa.Integer(), server_default="3", nullable=False),
        sa.Column("worker", sa.String()),
        sa.Column("lease_until", INSTANT),
        sa.Column("stage", sa.String()),
        sa.Column("progress", sa.Float(), server_default="0", nullable=False),
        sa.Column("message", sa.String()),
        sa.Column("error", JSONB()),
        sa.Column("queued_at", INSTANT, server_default=sa.func.now(), nullable=False),
        sa.Column("started_at", INSTANT),
        sa.Column("finished_at", INSTANT),
        sa.Column(
            "cancel_requested", sa.Boolean(), server_default=sa.text("false"), nullable=False
        ),
        sa.CheckConstraint(
            "state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')", "state"
        ),
        sa.CheckConstraint("progress BETWEEN 0 AND 1", "progress"),
        sa.Index(
            "ix_jobs_running_lease_until",
            "lease_until",
            postgresql_where=sa.text("state = 'running'"),
        ),
        sa.Index("ix_jobs_project_id_id", "project_id", "id"),
    )


def downgrade() -> None:
    raise NotImplementedError("the first revision is not undone; drop the database instead")
