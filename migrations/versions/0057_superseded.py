"""What was made anew supersedes what was made before: FRFs of a campaign's time blocks by those of
a later processing, mode sets by those that a later job identified with the same settings.
"""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0057_superseded"
down_revision = "0056_idempotency_keys"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the columns, and mark what has been made anew already."""
    op.add_column("frfs", sa.Column("superseded_by", sa.Uuid()))
    op.add_column("mode_sets", sa.Column("superseded_by", sa.Uuid()))
    op.add_column("mode_sets", sa.Column("settings", JSONB()))
    op.execute(
        """UPDATE frfs SET superseded_by = newer.id FROM (
             SELECT f.campaign_id, f.response_point, f.response_direction, f.reference_point, f.reference_direction,
                    max(f.processing_id::text)::uuid AS id
             FROM frfs f WHERE f.processing_id IS NOT NULL GROUP BY 1, 2, 3, 4, 5) newer
           WHERE frfs.processing_id < newer.id AND frfs.campaign_id = newer.campaign_id
             AND frfs.response_point = newer.response_point AND frfs.response_direction = newer.response_direction
             AND frfs.reference_point = newer.reference_point AND frfs.reference_direction = newer.reference_direction"""
    )
    op.execute(
        "UPDATE mode_sets s SET settings = i.options FROM identifications i WHERE i.id = s.job_id"
    )
    op.execute("""UPDATE mode_sets s
           SET settings = jsonb_build_object('identification', u.recipe -> 'identification', 'band_hz', u.recipe -> 'band_hz')
           FROM update_jobs u WHERE u.id = s.job_id""")
    op.execute("""UPDATE mode_sets SET superseded_by = newer.id FROM (
             SELECT campaign_id, settings, max(id::text)::uuid AS id FROM mode_sets
             WHERE settings IS NOT NULL GROUP BY 1, 2) newer
           WHERE mode_sets.campaign_id = newer.campaign_id AND mode_sets.settings = newer.settings
             AND mode_sets.id < newer.id""")


def downgrade() -> None:
    """List all of them again."""
    op.drop_column("mode_sets", "settings")
    op.drop_column("mode_sets", "superseded_by")
    op.drop_column("frfs", "superseded_by")
