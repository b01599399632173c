"""What each campaign was measured with, a row for each instrument: searched by index, with the
calibration that counted.
"""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0049_instrument_uses"
down_revision = "0048_sections_of_meshes"
branch_labels = None
depends_on = None

STATE = """
CREATE FUNCTION state_uses(keys uuid[]) RETURNS void LANGUAGE sql AS $$
DELETE FROM instrument_uses WHERE campaign_id = ANY (keys);
INSERT INTO instrument_uses (campaign_id, number, kind, serial, model, points, others,
    instrument_id, calibrated_on, calibrated_until, calibration_expired)
SELECT c.id, row_number() OVER (PARTITION BY c.id), u.kind, u.serial, u.model, u.points, u.others,
  i.id, k.performed_on, k.valid_until, c.tested > k.valid_until
FROM (
  SELECT campaigns.id, project_id, instruments AS stated, (performed_at AT TIME ZONE 'UTC')::date AS tested
  FROM campaigns JOIN structures ON structures.id = structure_id WHERE campaigns.id = ANY (keys)
) AS c
CROSS JOIN LATERAL (
  SELECT kind, stated -> kind ->> 'serial' AS serial, stated -> kind ->> 'model' AS model, NULL::bigint[] AS points,
    ARRAY(SELECT jsonb_path_query(stated, '$.sensors[*].points[*]')::bigint WHERE kind = 'sensor') AS others
  FROM unnest(ARRAY['hammer', 'sensor', 'analyser']) AS kind
  UNION ALL
  SELECT 'sensor', s ->> 'serial', s ->> 'model', ARRAY(SELECT jsonb_array_elements(s -> 'points')::bigint), '{}'
  FROM jsonb_path_query(stated, '$.sensors[*]') AS s
) AS u
LEFT JOIN instruments AS i ON i.project_id = c.project_id AND i.kind = u.kind AND i.serial = u.serial
LEFT JOIN LATERAL (
  SELECT performed_on, valid_until FROM jsonb_to_recordset(i.calibrations) AS (performed_on date, valid_until date)
  WHERE performed_on <= c.tested ORDER BY performed_on DESC LIMIT 1
) AS k ON true
WHERE coalesce(u.serial, u.model) IS NOT NULL
$$
"""
CAMPAIGN = """
CREATE FUNCTION campaign_stated() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  PERFORM pg_advisory_xact_lock_shared(hashtextextended(project_id::text, 47)) FROM structures WHERE id = NEW.structure_id;
  PERFORM state_uses(ARRAY[NEW.id]);
  RETURN NULL;
END $$;
CREATE TRIGGER campaign_stated AFTER INSERT OR UPDATE OF instruments, performed_at ON campaigns
  FOR EACH ROW EXECUTE FUNCTION campaign_stated()
"""
INSTRUMENT = """
CREATE FUNCTION instrument_stated() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  PERFORM pg_advisory_xact_lock(hashtextextended(NEW.project_id::text, 47));
  PERFORM state_uses(ARRAY(
    SELECT campaign_id FROM instrument_uses WHERE instrument_id = NEW.id
    UNION
    SELECT campaign_id FROM instrument_uses AS u
      JOIN campaigns ON campaigns.id = campaign_id JOIN structures ON structures.id = structure_id
    WHERE u.serial = NEW.serial AND u.kind = NEW.kind AND project_id = NEW.project_id));
  RETURN NULL;
END $$;
CREATE TRIGGER instrument_stated AFTER INSERT OR UPDATE OF serial, calibrations ON instruments
  FOR EACH ROW EXECUTE FUNCTION instrument_stated()
"""


def upgrade() -> None:
    """Add the table, what keeps it, and the rows of the campaigns that are there."""
    op.create_table(
        "instrument_uses",
        sa.Column("campaign_id", sa.Uuid(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        *(sa.Column(name, sa.String(), nullable=True) for name in ("serial", "model")),
        sa.Column("points", postgresql.ARRAY(sa.BigInteger()), nullable=True),
        sa.Column("others", postgresql.ARRAY(sa.BigInteger()), server_default="{}", nullable=False),
        sa.Column("instrument_id", sa.Uuid(), nullable=True),
        *(
            sa.Column(name, sa.Date(), nullable=True)
            for name in ("calibrated_on", "calibrated_until")
        ),
        sa.Column("calibration_expired", sa.Boolean(), nullable=True),
        *(
            sa.ForeignKeyConstraint(
                [f"{noun}_id"],
                [f"{noun}s.id"],
                name=f"fk_instrument_uses_{noun}_id_{noun}s",
                ondelete=then,
            )
            for noun, then in (("campaign", "CASCADE"), ("instrument", "SET NULL"))
        ),
        sa.PrimaryKeyConstraint("campaign_id", "number", name="pk_instrument_uses"),
    )
    for column in ("serial", "model", "instrument_id"):
        op.create_index(f"ix_instrument_uses_{column}", "instrument_uses", [column])
    op.create_index(
        "ix_instrument_uses_expired",
        "instrument_uses",
        ["campaign_id"],
        postgresql_where=sa.text("calibration_expired"),
    )
    for statement in (
        STATE,
        CAMPAIGN,
        INSTRUMENT,
        "SELECT state_uses(ARRAY(SELECT id FROM campaigns))",
    ):
        op.execute(statement)


def downgrade() -> None:
    """The campaigns have what they were measured with."""
    for noun in ("campaign", "instrument"):
        op.execute(f"DROP TRIGGER {noun}_stated ON {noun}s")
        op.execute(f"DROP FUNCTION {noun}_stated()")
    op.execute("DROP FUNCTION state_uses(uuid[])")
    op.drop_table("instrument_uses")
