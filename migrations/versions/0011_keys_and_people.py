"""Keys with scopes and an end, users that are disabled, projects and structures that are archived
or deleted, and an audit trail that nothing changes: a trigger refuses it, and what an event names
may be purged without touching the event.
"""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0011_keys_and_people"
down_revision = "0010_tickets"
branch_labels = None
depends_on = None

MOMENT = sa.DateTime(timezone=True)
ALL_SCOPES = '["read", "write", "jobs", "admin"]'
WITHIN_A_PROJECT = {
    "imports": ["fk_imports_id_jobs"],
    "frfs": ["fk_frfs_import_id_imports"],
    "mode_sets": ["fk_mode_sets_import_id_imports"],
    "update_jobs": [
        "fk_update_jobs_id_jobs",
        "fk_update_jobs_structure_version_id_structure_versions",
    ],
    "identifications": ["fk_identifications_id_jobs"],
    "monitors": ["fk_monitors_structure_version_id_structure_versions"],
    "monitor_runs": ["fk_monitor_runs_update_job_id_update_jobs"],
    "monitor_assessments": ["fk_monitor_assessments_id_jobs"],
}
"""Rows that go with their project, in whatever order: a purge has them checked when all of it is
gone.
"""

REFUSE = """
CREATE FUNCTION audit_is_kept() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  RAISE EXCEPTION 'the audit trail is not changed' USING ERRCODE = 'insufficient_privilege';
END $$
"""
KEEP = """
CREATE TRIGGER audit_is_kept BEFORE UPDATE OR DELETE OR TRUNCATE ON audit_events
FOR EACH STATEMENT EXECUTE FUNCTION audit_is_kept()
"""


def upgrade() -> None:
    op.add_column("users", sa.Column("disabled_at", MOMENT))
    op.add_column("api_keys", sa.Column("expires_at", MOMENT))
    op.add_column(
        "api_keys",
        sa.Column(
            "scopes", postgresql.JSONB, nullable=False, server_default=sa.text(f"'{ALL_SCOPES}'")
        ),
    )
    op.add_column(
        "projects", sa.Column("updated_at", MOMENT, nullable=False, server_default=sa.func.now())
    )
    op.add_column("projects", sa.Column("archived_at", MOMENT))
    op.add_column("projects", sa.Column("deleted_at", MOMENT))
    op.add_column("structures", sa.Column("deleted_at", MOMENT))
    op.drop_constraint("fk_audit_events_user_id_users", "audit_events", type_="foreignkey")
    op.drop_constraint("fk_audit_events_project_id_projects", "audit_events", type_="foreignkey")
    op.execute(REFUSE)
    op.execute(KEEP)
    _alter("DEFERRABLE")


def _alter(how: str) -> None:
    for table, constraints in WITHIN_A_PROJECT.items():
        for constraint in constraints:
            op.execute(f"ALTER TABLE {table} ALTER CONSTRAINT {constraint} {how}")


def downgrade() -> None:
    _alter("NOT DEFERRABLE")
    op.execute("DROP TRIGGER audit_is_kept ON audit_events")
    op.execute("DROP FUNCTION audit_is_kept()")
    for column, table in (("user_id", "users"), ("project_id", "projects")):
        op.execute(
            f"UPDATE audit_events SET {column} = NULL WHERE {column} NOT IN (SELECT id FROM"
            f" {table})"
        )
        op.create_foreign_key(
            f"fk_audit_events_{column}_{table}",
            "audit_events",
            table,
            [column],
            ["id"],
            ondelete="SET NULL",
        )
    op.drop_column("structures", "deleted_at")
    for column in ("deleted_at", "archived_at", "updated_at"):
        op.drop_column("projects", column)
    op.drop_column("api_keys", "scopes")
    op.drop_column("api_keys", "expires_at")
    op.drop_column("users", "disabled_at")
