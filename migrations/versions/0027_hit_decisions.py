"""Decisions about hits are kept: who accepted or refused one by hand, when and why."""

import sqlalchemy as sa
from alembic import op

revision = "0027_hit_decisions"
down_revision = "0026_purged_processings"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """A table of them."""
    op.create_table(
        "hit_decisions",
        sa.Column("id", sa.Uuid(), server_default=sa.text("uuidv7()"), nullable=False),
        sa.Column(
            "created_at",
            sa.DateTime(timezone=True),
            server_default=sa.text("now()"),
            nullable=False,
        ),
        sa.Column("campaign_id", sa.Uuid(), nullable=False),
        sa.Column("point", sa.BigInteger(), nullable=False),
        sa.Column("direction", sa.Integer(), nullable=False),
        sa.Column("hit", sa.BigInteger(), nullable=False),
        sa.Column("good", sa.Boolean(), nullable=True),
        sa.Column("why", sa.String(), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["campaign_id"],
            ["campaigns.id"],
            name="fk_hit_decisions_campaign_id_campaigns",
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("id", name="pk_hit_decisions"),
    )
    op.create_index("ix_hit_decisions_campaign_id_id", "hit_decisions", ["campaign_id", "id"])


def downgrade() -> None:
    """Forget them."""
    op.drop_table("hit_decisions")
