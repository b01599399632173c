"""What a search asks: constants and verdicts of results in rows, words of structures and campaigns,
and indexes.
"""

import sqlalchemy as sa
from alembic import op

revision = "0031_search"
down_revision = "0030_start_sample"
branch_labels = None
depends_on = None

STRUCTURE_WORDS = "to_tsvector('simple'::regconfig, name)"
CAMPAIGN_WORDS = (
    "(to_tsvector('simple'::regconfig, (name::text || ' '::text) || notes::text)"
    """ || jsonb_to_tsvector('simple'::regconfig, instruments, '["string", "numeric"]'::jsonb))"""
)
DRIVING_POINT = (
    "response_point = reference_point AND abs(response_direction) = abs(reference_direction)"
)
INDEXES = {
    "ix_campaigns_performed_at": ("campaigns", ["performed_at"]),
    "ix_frfs_reference_point_id": ("frfs", ["reference_point", "id"]),
    "ix_modes_frequency_hz": ("modes", ["frequency_hz"]),
}


def upgrade() -> None:
    """Results before these tables are found too, where their documents state the values."""
    op.add_column("update_results", sa.Column("verdict", sa.String(), nullable=True))
    op.execute("UPDATE update_results SET verdict = document -> 'verdict' ->> 'level'")
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
    op.execute(
        "INSERT INTO result_constants SELECT DISTINCT ON (r.id, p ->> 'name') r.id, p ->> 'name',"
        " (p ->> 'estimate')::float8, (p ->> 'standard_deviation')::float8,"
        " (p -> 'interval_95' ->> 0)::float8, (p -> 'interval_95' ->> 1)::float8"
        " FROM update_results AS r, json_array_elements(r.document -> 'parameters') AS p"
        " WHERE p ->> 'estimate' IS NOT NULL"
    )
    op.create_index(
        "ix_result_constants_name_estimate_result_id",
        "result_constants",
        ["name", "estimate", "result_id"],
    )
    op.create_index(
        "ix_structures_words", "structures", [sa.text(STRUCTURE_WORDS)], postgresql_using="gin"
    )
    op.create_index(
        "ix_campaigns_words", "campaigns", [sa.text(CAMPAIGN_WORDS)], postgresql_using="gin"
    )
    for name, (table, columns) in INDEXES.items():
        op.create_index(name, table, columns)
    op.create_index(
        "ix_frfs_driving_point",
        "frfs",
        ["campaign_id", "id"],
        postgresql_where=sa.text(DRIVING_POINT),
    )


def downgrade() -> None:
    """The documents have it all."""
    op.drop_index("ix_frfs_driving_point", "frfs")
    for name, (table, _) in INDEXES.items():
        op.drop_index(name, table)
    op.drop_index("ix_campaigns_words", "campaigns")
    op.drop_index("ix_structures_words", "structures")
    op.drop_table("result_constants")
    op.drop_column("update_results", "verdict")
