"""What values of FRFs grow by in harder hits."""

import sqlalchemy as sa
from alembic import op

revision = "0063_growth"
down_revision = "0062_attachments"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add it; of FRFs of before it is not known."""
    op.add_column("frfs", sa.Column("growth_sha256", sa.LargeBinary()))
    op.add_column("frfs", sa.Column("growth", sa.LargeBinary()))
    op.execute("ALTER TABLE frfs ALTER COLUMN growth SET STORAGE EXTERNAL")
