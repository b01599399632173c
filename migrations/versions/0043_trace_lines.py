"""A file's trace lines, which say how its points are joined."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0043_trace_lines"
down_revision = "0042_saved_searches"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Those of files that were read before stay in their originals."""
    op.add_column(
        "imports", sa.Column("trace_lines", postgresql.JSONB(none_as_null=True), nullable=True)
    )


def downgrade() -> None:
    """Forget them."""
    op.drop_column("imports", "trace_lines")
