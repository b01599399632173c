"""A calibration's sensitivity of 0, which was taken, says that none is stated."""

from alembic import op

revision = "0055_sensitivities"
down_revision = "0049_instrument_uses"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """State none where it is 0; the audit trail keeps what was sent."""
    op.execute("""UPDATE instruments SET calibrations = (SELECT jsonb_agg(
             CASE WHEN c -> 'sensitivity' = '0' THEN c || '{"sensitivity": null}' ELSE c END ORDER BY n)
           FROM jsonb_array_elements(calibrations) WITH ORDINALITY AS one (c, n))
           WHERE jsonb_path_exists(calibrations, '$[*] ? (@.sensitivity == 0)')""")


def downgrade() -> None:
    """Nothing: null was always allowed."""
