"""The constants of a result and its campaign stand in its row, so that a search for results reads
one table.
"""

import sqlalchemy as sa
from alembic import op

revision = "0040_found_by"
down_revision = "0031_search"
branch_labels = None
depends_on = None

CONSTANTS = ("Ex", "Ey", "Gxy", "Gxz", "Gyz", "a0", "a1")
ENDS = {"": "estimate", "_sd": "standard_deviation", "_low": "low", "_high": "high"}


def upgrade() -> None:
    for name in CONSTANTS:
        for end in ENDS:
            op.add_column(
                "update_results", sa.Column(f"{name}{end}".lower(), sa.Float(), nullable=True)
            )
    values = ", ".join(
        f"{name}{end} = (SELECT {column} FROM result_constants AS c WHERE c.result_id = r.id AND"
        f" c.name = '{name}')"
        for name in CONSTANTS
        for end, column in ENDS.items()
    )
    op.add_column("update_results", sa.Column("campaign_id", sa.Uuid(), nullable=True))
    campaign = "(SELECT campaign_id FROM update_jobs AS j WHERE j.id = r.id)"
    op.execute(f"UPDATE update_results AS r SET campaign_id = {campaign}, {values}")
    op.alter_column("update_results", "campaign_id", nullable=False)
    op.create_foreign_key(
        "fk_update_results_campaign_id_campaigns",
        "update_results",
        "campaigns",
        ["campaign_id"],
        ["id"],
        ondelete="CASCADE",
    )
    op.create_index("ix_update_results_campaign_id", "update_results", ["campaign_id"])
    op.drop_table("result_constants")
    for name in CONSTANTS:
        op.create_index(f"ix_update_results_{name.lower()}", "update_results", [name.lower()])


def downgrade() -> None:
    """Constants of other names are not found before either; the documents have them."""
    op.create_table(
        "result_constants",
        sa.Column("result_id", sa.Uuid(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("estimate", sa.Float(), nullable=False),
        sa.Column("standard_deviation", sa.Float(), nullable=True),
        sa.Column("low", sa.Float(), nullable=True),
        sa.Column("high", sa.Float(), nullable=True),
        sa.ForeignKeyConstraint(
            ["result_id"],
            ["update_results.id"],
            name="fk_result_constants_result_id_update_results",
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("result_id", "name", name="pk_result_constants"),
    )
    op.create_index(
        "ix_result_constants_name_estimate_result_id",
        "result_constants",
        ["name", "estimate", "result_id"],
    )
    op.drop_index("ix_update_results_campaign_id", "update_results")
    op.drop_column("update_results", "campaign_id")
    for name in CONSTANTS:
        op.drop_index(f"ix_update_results_{name.lower()}", "update_results")
        columns = ", ".join(f"{name}{end}" for end in ENDS)
        op.execute(
            f"INSERT INTO result_constants SELECT id, '{name}', {columns} FROM update_results WHERE"
            f" {name} IS NOT NULL"
        )
        for end in ENDS:
            op.drop_column("update_results", f"{name}{end}".lower())
