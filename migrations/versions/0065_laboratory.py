"""The laboratory whose reports they are."""

import sqlalchemy as sa
from alembic import op

revision = "0065_laboratory"
down_revision = "0064_loads"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add its table; until somebody states one, the settings do."""
    now = sa.func.now()
    op.create_table(
        "laboratory",
        sa.Column("id", sa.Uuid(), server_default=sa.text("uuidv7()"), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), server_default=now, nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("address", sa.String(), nullable=False),
        sa.Column("logo", sa.LargeBinary()),
        sa.PrimaryKeyConstraint("id", name="pk_laboratory"),
    )
