"""One table of idempotency keys, for every operation that creates; the keys of update jobs come
into it.

What such a key answers now is its job as it is; which user it was is in the audit trail. Its
request has no SHA-256.
"""

import sqlalchemy as sa
from alembic import op

revision = "0056_idempotency_keys"
down_revision = "0055_sensitivities"
branch_labels = None
depends_on = None

_JOB = """
  'id', j.id, 'status', j.state, 'stage', j.stage, 'progress', j.progress, 'attempt', j.attempt, 'message', j.message,
  'error', j.error, 'created_at', j.created_at, 'started_at', j.started_at, 'finished_at', j.finished_at,
  'priority', j.priority"""
_UPDATE = f"""jsonb_build_object({_JOB}, 'campaign_id', u.campaign_id, 'campaign_name', c.name,
  'structure_version_id', u.structure_version_id, 'recipe', u.recipe)"""
_JOINT = f"""jsonb_build_object({_JOB}, 'project_id', u.project_id, 'campaigns', u.campaigns, 'request', u.request)"""
_SEPARATOR = "chr(31)"  # between the user, the key and the number of a batch's jobs


def _answer(body: str, location: str) -> str:
    """What the API keeps: status, headers and body as JSON, in bytes."""
    headers = (
        f"""jsonb_build_array(jsonb_build_array('content-type', 'application/json'){location})"""
    )
    return f"convert_to(jsonb_build_array(202, {headers}, ({body})::text)::text, 'UTF8')"


def _located(noun: str) -> str:
    return f", jsonb_build_array('location', '/api/v1/{noun}/' || u.id)"


def upgrade() -> None:
    """Make the table and fill it. Of two jobs of a user under one key, in two projects, the newer
    has it.
    """
    op.create_table(
        "idempotency_keys",
        sa.Column("user_id", sa.Uuid(), nullable=False),
        sa.Column("operation", sa.String(), nullable=False),
        sa.Column("key", sa.String(), nullable=False),
        sa.Column("request_sha256", sa.LargeBinary()),
        sa.Column("answer", sa.LargeBinary(), nullable=False),
        sa.Column("sealed", sa.Boolean(), server_default=sa.text("false"), nullable=False),
        sa.Column(
            "created_at", sa.DateTime(timezone=True), server_default=sa.func.now(), nullable=False
        ),
        sa.ForeignKeyConstraint(
            ["user_id"],
            ["users.id"],
            name=op.f("fk_idempotency_keys_user_id_users"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("user_id", "operation", "key", name=op.f("pk_idempotency_keys")),
    )
    into = "INSERT INTO idempotency_keys (user_id, operation, key, answer, created_at)"
    by_user = (
        "JOIN audit_events a ON a.subject_id = u.id AND a.action = '{}.create' JOIN users w ON w.id"
        " = a.user_id"
    )
    campaign = "/campaigns/{campaign_id}/update-jobs"
    op.execute(
        f"""{into} SELECT DISTINCT ON (w.id, u.idempotency_key) w.id, '{campaign}', u.idempotency_key,
              {_answer(_UPDATE, _located("update-jobs"))}, j.created_at
            FROM update_jobs u JOIN jobs j ON j.id = u.id JOIN campaigns c ON c.id = u.campaign_id
            {by_user.format("update_job")}
            WHERE u.idempotency_key IS NOT NULL AND strpos(u.idempotency_key, {_SEPARATOR}) = 0
            ORDER BY w.id, u.idempotency_key, u.id DESC"""
    )
    batch = (
        f"jsonb_build_object('items', jsonb_agg({_UPDATE} ORDER BY u.idempotency_key), 'joint',"
        " NULL)"
    )
    op.execute(
        f"""{into} SELECT w.id, '/update-jobs', split_part(u.idempotency_key, {_SEPARATOR}, 2),
              {_answer(batch, "")}, min(j.created_at)
            FROM update_jobs u JOIN jobs j ON j.id = u.id JOIN campaigns c ON c.id = u.campaign_id
            JOIN users w ON w.id::text = split_part(u.idempotency_key, {_SEPARATOR}, 1)
            WHERE strpos(u.idempotency_key, {_SEPARATOR}) > 0
            GROUP BY w.id, split_part(u.idempotency_key, {_SEPARATOR}, 2)"""
    )
    joint = f"jsonb_build_object('items', jsonb_build_array(), 'joint', {_JOINT})"
    op.execute(
        f"""{into} SELECT DISTINCT ON (w.id, u.idempotency_key) w.id, '/update-jobs', u.idempotency_key,
              {_answer(joint, _located("joint-updates"))}, j.created_at
            FROM joint_updates u JOIN jobs j ON j.id = u.id {by_user.format("joint_update")}
            WHERE u.idempotency_key IS NOT NULL ORDER BY w.id, u.idempotency_key, u.id DESC
            ON CONFLICT DO NOTHING"""
    )


def downgrade() -> None:
    """Drop the table; the keys of jobs that came before are still in their rows."""
    op.drop_table("idempotency_keys")
