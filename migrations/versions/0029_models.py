"""Structures can be models that users send: decks, with what was read of them."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0029_models"
down_revision = "0028_shapes"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """A table of them, and which one a structure's version is."""
    op.create_table(
        "structure_models",
        sa.Column("id", sa.Uuid(), nullable=False),
        sa.Column("structure_id", sa.Uuid(), nullable=False),
        sa.Column("filename", sa.String(), nullable=False),
        sa.Column("sha256", sa.LargeBinary(), nullable=False),
        sa.Column("units", sa.String(), nullable=True),
        sa.Column("accepted", JSONB(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=True),
        sa.Column("arrays", sa.LargeBinary(), nullable=True),
        sa.Column("arrays_sha256", sa.LargeBinary(), nullable=True),
        sa.ForeignKeyConstraint(
            ["id"], ["jobs.id"], name="fk_structure_models_id_jobs", deferrable=True
        ),
        sa.ForeignKeyConstraint(
            ["structure_id"],
            ["structures.id"],
            name="fk_structure_models_structure_id_structures",
            ondelete="CASCADE",
        ),
        sa.ForeignKeyConstraint(
            ["sha256"], ["originals.sha256"], name="fk_structure_models_sha256_originals"
        ),
        sa.PrimaryKeyConstraint("id", name="pk_structure_models"),
    )
    op.create_index(
        "ix_structure_models_structure_id_id", "structure_models", ["structure_id", "id"]
    )
    op.execute("ALTER TABLE structure_models ALTER COLUMN arrays SET STORAGE EXTERNAL")
    op.add_column("structure_versions", sa.Column("model", sa.Uuid(), nullable=True))
    op.create_foreign_key(
        "fk_structure_versions_model_structure_models",
        "structure_versions",
        "structure_models",
        ["model"],
        ["id"],
        deferrable=True,
    )


def downgrade() -> None:
    """Forget them, and with them what structures were."""
    op.drop_column("structure_versions", "model")
    op.drop_table("structure_models")
