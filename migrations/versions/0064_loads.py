"""Rate of the window that an identification took out of the poles of a mode set."""

import sqlalchemy as sa
from alembic import op

revision = "0064_loads"
down_revision = "0063_growth"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Nothing was taken out before."""
    op.add_column(
        "mode_sets",
        sa.Column("window_taken_out_per_s", sa.Float(), server_default="0", nullable=False),
    )
