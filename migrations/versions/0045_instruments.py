"""Instruments with their calibrations; and constants of results that have no column, such as those
of sets.
"""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0045_instruments"
down_revision = "0044_sets_of_coupons"
branch_labels = None
depends_on = None

COLUMNS = "'Ex', 'Ey', 'Gxy', 'Gxz', 'Gyz', 'a0', 'a1'"
OTHERS = f"""
SELECT jsonb_object_agg(p ->> 'name', jsonb_build_object('estimate', p -> 'estimate', 'sd', p -> 'standard_deviation',
  'low', p -> 'interval_95' -> 0, 'high', p -> 'interval_95' -> 1))
FROM json_array_elements(r.document -> 'parameters') AS p WHERE p ->> 'name' NOT IN ({COLUMNS})
"""


def upgrade() -> None:
    now = sa.func.now()
    op.create_table(
        "instruments",
        sa.Column("id", sa.Uuid(), server_default=sa.text("uuidv7()"), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), server_default=now, nullable=False),
        sa.Column("project_id", sa.Uuid(), nullable=False),
        *(
            sa.Column(name, sa.String(), nullable=False)
            for name in ("kind", "serial", "model", "notes")
        ),
        sa.Column("calibrations", postgresql.JSONB(), nullable=False),
        sa.Column("updated_at", sa.DateTime(timezone=True), server_default=now, nullable=False),
        sa.Column("deleted_at", sa.DateTime(timezone=True), nullable=True),
        sa.ForeignKeyConstraint(
            ["project_id"],
            ["projects.id"],
            name="fk_instruments_project_id_projects",
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("id", name="pk_instruments"),
        sa.UniqueConstraint(
            "project_id", "kind", "serial", name="uq_instruments_project_id_kind_serial"
        ),
    )

    empty = sa.Column("constants", postgresql.JSONB(), server_default="{}", nullable=False)
    op.add_column("update_results", empty)
    op.execute(f"UPDATE update_results AS r SET constants = coalesce(({OTHERS}), '{{}}')")


def downgrade() -> None:
    """The documents have the constants."""
    op.drop_column("update_results", "constants")
    op.drop_table("instruments")
