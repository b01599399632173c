"""Files of every format come in by imports; time blocks name the import that brought them."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0025_one_door"
down_revision = "0024_pieces"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Columns of what a file is and how it is read; what was imported until now was UFF."""
    for name in ("format", "kind"):
        op.add_column("imports", sa.Column(name, sa.String(), nullable=True))
    for name in ("mapping", "found"):
        op.add_column("imports", sa.Column(name, JSONB(none_as_null=True), nullable=True))
    op.execute("UPDATE imports SET format = 'uff'")
    op.add_column("records", sa.Column("import_id", sa.Uuid(), nullable=True))
    op.create_foreign_key(
        op.f("fk_records_import_id_imports"),
        "records",
        "imports",
        ["import_id"],
        ["id"],
        deferrable=True,
    )
    op.create_index(op.f("ix_records_import_id"), "records", ["import_id"])


def downgrade() -> None:
    """Forget them."""
    op.drop_index(op.f("ix_records_import_id"), "records")
    op.drop_constraint(op.f("fk_records_import_id_imports"), "records", type_="foreignkey")
    op.drop_column("records", "import_id")
    for name in ("format", "kind", "mapping", "found"):
        op.drop_column("imports", name)
