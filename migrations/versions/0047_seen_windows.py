"""How well the exponential window is known that a processing saw in the noise of hits."""

import sqlalchemy as sa
from alembic import op

revision = "0047_seen_windows"
down_revision = "0046_forecasts"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the column."""
    op.add_column("frfs", sa.Column("window_rate_sd_per_s", sa.Float(), nullable=True))


def downgrade() -> None:
    """Drop it."""
    op.drop_column("frfs", "window_rate_sd_per_s")
