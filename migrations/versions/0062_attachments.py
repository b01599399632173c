"""Attachments: files beside projects, structures, campaigns, updates and monitors."""

import sqlalchemy as sa
from alembic import op

revision = "0062_attachments"
down_revision = "0061_modes"
branch_labels = None
depends_on = None

OWNERS = {
    "project_id": "projects",
    "structure_id": "structures",
    "campaign_id": "campaigns",
    "update_job_id": "update_jobs",
    "monitor_id": "monitors",
}


def upgrade() -> None:
    """Add the table."""
    op.create_table(
        "attachments",
        sa.Column("id", sa.Uuid(), server_default=sa.text("uuidv7()"), nullable=False),
        sa.Column(
            "created_at",
            sa.DateTime(timezone=True),
            server_default=sa.func.now(),
            nullable=False,
        ),
        *(sa.Column(name, sa.Uuid(), nullable=name != "project_id") for name in OWNERS),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("caption", sa.String(), nullable=False),
        sa.Column("media_type", sa.String(), nullable=False),
        sa.Column("size", sa.BigInteger(), nullable=False),
        sa.Column("sha256", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_attachments"),
        sa.ForeignKeyConstraint(
            ["sha256"], ["originals.sha256"], name="fk_attachments_sha256_originals"
        ),
        *(
            sa.ForeignKeyConstraint(
                [name], [f"{table}.id"], name=f"fk_attachments_{name}_{table}", ondelete="CASCADE"
            )
            for name, table in OWNERS.items()
        ),
    )
    for name in OWNERS:
        op.create_index(f"ix_attachments_{name}_id", "attachments", [name, "id"])
    op.create_index("ix_attachments_sha256", "attachments", ["sha256"])
    words = (
        "to_tsvector('simple'::regconfig, (translate(name::text, '._-'::text, '   '::text)"
        " || ' '::text) || caption::text)"
    )
    op.create_index("ix_attachments_words", "attachments", [sa.text(words)], postgresql_using="gin")
