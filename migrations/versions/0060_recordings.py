"""Recordings of responses to loads that nobody measured, their half spectra, and what moved the
structure of a mode set.
"""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0060_recordings"
down_revision = "0059_updates"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add both tables; mode sets of before are of measured loads."""
    now = sa.func.now()
    op.create_table(
        "recordings",
        sa.Column("id", sa.Uuid(), server_default=sa.text("uuidv7()"), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), server_default=now, nullable=False),
        sa.Column("campaign_id", sa.Uuid(), nullable=False),
        sa.Column("import_id", sa.Uuid(), nullable=False),
        sa.Column("filename", sa.String(), nullable=False),
        sa.Column("format", sa.String(), nullable=False),
        sa.Column("mapping", JSONB(), nullable=False),
        sa.Column("sample_rate_hz", sa.Float(), nullable=False),
        sa.Column("samples", sa.BigInteger(), nullable=False),
        sa.Column("channels", JSONB(), nullable=False),
        sa.Column("file_sha256", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_recordings"),
        sa.ForeignKeyConstraint(
            ["campaign_id"],
            ["campaigns.id"],
            name="fk_recordings_campaign_id_campaigns",
            ondelete="CASCADE",
        ),
        sa.ForeignKeyConstraint(
            ["import_id"], ["imports.id"], name="fk_recordings_import_id_imports", deferrable=True
        ),
    )
    op.create_index("ix_recordings_campaign_id_id", "recordings", ["campaign_id", "id"])
    op.create_index("ix_recordings_import_id", "recordings", ["import_id"])
    op.create_table(
        "half_spectra",
        sa.Column("recording_id", sa.Uuid(), nullable=False),
        sa.Column("processing_id", sa.Uuid(), nullable=False),
        sa.Column("document", JSONB(), nullable=False),
        sa.Column("sha256", sa.LargeBinary(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), server_default=now, nullable=False),
        sa.PrimaryKeyConstraint("recording_id", name="pk_half_spectra"),
        sa.ForeignKeyConstraint(
            ["recording_id"],
            ["recordings.id"],
            name="fk_half_spectra_recording_id_recordings",
            ondelete="CASCADE",
        ),
        sa.ForeignKeyConstraint(
            ["processing_id"],
            ["processings.id"],
            name="fk_half_spectra_processing_id_processings",
        ),
    )
    op.execute("ALTER TABLE half_spectra ALTER COLUMN data SET STORAGE EXTERNAL")
    op.add_column(
        "mode_sets",
        sa.Column("excitation", sa.String(), server_default="measured", nullable=False),
    )
