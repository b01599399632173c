"""Tags and free metadata of projects, structures, campaigns, FRFs and results, and what a project
demands of them.
"""

from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0041_labels"
down_revision = "0040_found_by"
branch_labels = None
depends_on = None

TABLES = ("projects", "structures", "campaigns", "frfs", "update_results")
LABELS: dict[str, Any] = {"tags": postgresql.ARRAY(sa.String()), "meta": postgresql.JSONB()}


def upgrade() -> None:
    for table in TABLES:
        for name, kind in LABELS.items():
            op.add_column(table, sa.Column(name, kind, server_default="{}", nullable=False))
            some = sa.text(f"{name} <> '{{}}'")
            op.create_index(
                f"ix_{table}_{name}", table, [name], postgresql_using="gin", postgresql_where=some
            )
    op.add_column(
        "projects", sa.Column("schemas", postgresql.JSONB(), server_default="{}", nullable=False)
    )


def downgrade() -> None:
    op.drop_column("projects", "schemas")
    for table in TABLES:
        for name in LABELS:
            op.drop_index(f"ix_{table}_{name}", table)
            op.drop_column(table, name)
