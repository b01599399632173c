"""A time block says where in its recording it begins."""

import sqlalchemy as sa
from alembic import op

revision = "0030_start_sample"
down_revision = "0029_models"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Blocks of before are of no recording, or say it in their label alone."""
    op.add_column("records", sa.Column("start_sample", sa.BigInteger(), nullable=True))


def downgrade() -> None:
    """Forget where they begin."""
    op.drop_column("records", "start_sample")
