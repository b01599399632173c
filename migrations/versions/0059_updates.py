"""One table of updates, of one campaign or of several, and one of their results.

An update of several campaigns keeps its request and names no single campaign. Keys of idempotency
have had a table of their own since `0056_idempotency_keys`.
"""

import io
import zipfile

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0059_updates"
down_revision = "0058_channels"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Move joint updates, their results and their jobs to the tables and the kind of updates."""
    op.drop_column("update_jobs", "idempotency_key")
    for name in ("request", "campaigns"):
        op.add_column("update_jobs", sa.Column(name, JSONB()))
    op.execute(
        """UPDATE update_jobs SET campaigns = jsonb_build_array(jsonb_build_object(
             'campaign_id', campaign_id, 'structure_version_id', structure_version_id))"""
    )
    for table, column in (
        ("update_jobs", "campaign_id"),
        ("update_jobs", "structure_version_id"),
        ("update_results", "campaign_id"),
    ):
        op.alter_column(table, column, nullable=True)
    op.execute(
        """INSERT INTO update_jobs (id, project_id, recipe, request, campaigns)
           SELECT id, project_id, coalesce(nullif(request -> 'recipe', 'null'), '{}'), request, campaigns
           FROM joint_updates"""
    )
    op.get_bind().execute(
        sa.text(
            """INSERT INTO update_results (id, created_at, verdict, document, prediction, constants)
               SELECT u.id, coalesce(j.finished_at, j.created_at), document #>> '{verdict,level}',
                 (regexp_replace(document::text, '\\}\\s*$', '') || ', "version": 3}')::json,
                 :nothing,
                 (SELECT coalesce(jsonb_object_agg(p ->> 'name', jsonb_build_object(
                    'estimate', p -> 'estimate', 'sd', p -> 'standard_deviation',
                    'low', p #> '{interval_95,0}', 'high', p #> '{interval_95,1}')), '{}')
                  FROM jsonb_array_elements(document::jsonb -> 'parameters') p)
               FROM joint_updates u JOIN jobs j ON j.id = u.id WHERE document IS NOT NULL"""
        ),
        {"nothing": _no_arrays()},
    )
    op.alter_column("update_jobs", "campaigns", nullable=False)
    op.execute("UPDATE jobs SET kind = 'update' WHERE kind = 'joint_update'")
    op.drop_table("joint_updates")


def _no_arrays() -> bytes:
    """An npz without arrays."""
    file = io.BytesIO()
    zipfile.ZipFile(file, "w").close()
    return file.getvalue()
