"""Chunks of uploaded files that fill a page each, in the table itself; larger ones, of earlier
versions, stay as they are.
"""

from alembic import op

revision = "0009_original_rows"
down_revision = "0008_deleted_monitors"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # Bytes of a row up to which it stays in the page.
    op.execute("ALTER TABLE original_chunks SET (toast_tuple_target = 8160)")


def downgrade() -> None:
    op.execute("ALTER TABLE original_chunks RESET (toast_tuple_target)")
