"""Runs are followed once: their tracks are stored, and the points of a series are rows."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0068_tracks"
down_revision = "0065_laboratory"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add their tables; points move there from the documents of series that were judged."""
    when, json = sa.DateTime(timezone=True), postgresql.JSONB(astext_type=sa.Text())
    op.create_table(
        "monitor_tracks",
        sa.Column("run_id", sa.Uuid(), nullable=False),
        sa.Column("series_id", sa.Uuid(), nullable=False),
        sa.Column("performed_at", when, nullable=False),
        sa.Column("chain", sa.LargeBinary(), nullable=False),
        sa.Column("numbers", json, nullable=False),
        sa.Column("identity_sd", json, nullable=False),
        sa.Column("state", sa.JSON()),
        sa.PrimaryKeyConstraint("run_id", name="pk_monitor_tracks"),
        sa.ForeignKeyConstraint(
            ["run_id"],
            ["monitor_runs.id"],
            name="fk_monitor_tracks_run_id_monitor_runs",
            ondelete="CASCADE",
        ),
        sa.ForeignKeyConstraint(
            ["series_id"],
            ["monitor_series.id"],
            name="fk_monitor_tracks_series_id_monitor_series",
            ondelete="CASCADE",
        ),
    )
    op.create_index(
        "ix_monitor_tracks_series_id_performed_at", "monitor_tracks", ["series_id", "performed_at"]
    )
    op.create_table(
        "monitor_points",
        sa.Column("series_id", sa.Uuid(), nullable=False),
        sa.Column("parameter", sa.String(), nullable=False),
        sa.Column("performed_at", when, nullable=False),
        sa.Column("campaign_id", sa.Uuid(), nullable=False),
        sa.Column("raw", sa.Float(), nullable=False),
        sa.Column("standard_deviation", sa.Float(), nullable=False),
        sa.Column("corrected", sa.Float()),
        sa.Column("in_baseline", sa.Boolean(), nullable=False),
        sa.Column("judged", json),
        sa.Column("condition", json),
        sa.PrimaryKeyConstraint("series_id", "parameter", "performed_at", name="pk_monitor_points"),
        sa.ForeignKeyConstraint(
            ["series_id"],
            ["monitor_series.id"],
            name="fk_monitor_points_series_id_monitor_series",
            ondelete="CASCADE",
        ),
    )
    op.execute(
        """
        INSERT INTO monitor_points (series_id, parameter, performed_at, campaign_id, raw,
            standard_deviation, corrected, in_baseline, judged)
        SELECT series.id, row->>'name', (point->>'performed_at')::timestamptz,
            (point->>'campaign_id')::uuid, (point->>'raw')::float8,
            (point->>'standard_deviation')::float8, (point->>'corrected')::float8,
            (point->>'in_baseline')::boolean, nullif((point->'judged')::jsonb, 'null'::jsonb)
        FROM monitor_series AS series,
            json_array_elements(series.document->'parameters') AS row,
            json_array_elements(row->'points') AS point
        ON CONFLICT DO NOTHING
        """
    )
    op.execute(
        """
        UPDATE monitor_series SET document = jsonb_set(document::jsonb, '{parameters}', (
            SELECT coalesce(jsonb_agg(row - 'points' ORDER BY place), '[]'::jsonb)
            FROM jsonb_array_elements(document::jsonb->'parameters')
                WITH ORDINALITY AS each (row, place)
        ))::json
        WHERE json_typeof(document->'parameters') = 'array'
        """
    )
