"""What each project stores, entered as it is stored; what is there already is entered once for each
campaign and kind.
"""

import sqlalchemy as sa
from alembic import op

revision = "0020_storage"
down_revision = "0019_inputs"
branch_labels = None
depends_on = None

OWNERS = ("projects", "structures", "campaigns")
OF_CAMPAIGNS = {
    "files": (
        "SELECT campaign_id, size FROM (SELECT DISTINCT campaign_id, sha256 FROM imports) i JOIN"
        " originals USING (sha256)"
    ),
    "frfs": (
        "SELECT campaign_id, octet_length(data) + coalesce(octet_length(coherence), 0)"
        " + coalesce(octet_length(variance), 0) + coalesce(octet_length(axis), 0) FROM frfs"
    ),
    "records": "SELECT campaign_id, octet_length(data) FROM records",
    "modes": (
        "SELECT campaign_id, coalesce(octet_length(shape::text), 0) FROM modes m JOIN mode_sets s"
        " ON s.id = m.mode_set_id WHERE origin = 'typed'"
    ),
    "results": (
        "SELECT campaign_id, octet_length(prediction) + octet_length(document::text)"
        " FROM update_results r JOIN update_jobs j ON j.id = r.id"
    ),
}
CURVES = (
    "SELECT structure_id, octet_length(file) + octet_length(data) FROM coupon_curves v"
    " JOIN coupons c ON c.id = v.coupon_id JOIN coupon_batches b ON b.id = c.batch_id"
)


def upgrade() -> None:
    """One row for each campaign and kind, with a key and a time that do not depend on when it is
    made.
    """
    op.create_table(
        "stored_bytes",
        sa.Column("id", sa.Uuid, server_default=sa.text("uuidv7()"), nullable=False),
        sa.Column(
            "created_at", sa.DateTime(timezone=True), server_default=sa.func.now(), nullable=False
        ),
        *(sa.Column(f"{owner[:-1]}_id", sa.Uuid, nullable=owner != "projects") for owner in OWNERS),
        sa.Column("kind", sa.String, nullable=False),
        sa.Column("size", sa.BigInteger, nullable=False),
        *(
            sa.ForeignKeyConstraint(
                [f"{owner[:-1]}_id"],
                [f"{owner}.id"],
                f"fk_stored_bytes_{owner[:-1]}_id_{owner}",
                ondelete="CASCADE",
            )
            for owner in OWNERS
        ),
        sa.PrimaryKeyConstraint("id", name="pk_stored_bytes"),
    )
    op.create_index(
        "ix_stored_bytes_project_id_kind_size", "stored_bytes", ["project_id", "kind", "size"]
    )
    op.create_index("ix_stored_bytes_structure_id", "stored_bytes", ["structure_id"])
    op.create_index("ix_stored_bytes_campaign_id", "stored_bytes", ["campaign_id"])
    for kind, sizes in OF_CAMPAIGNS.items():
        op.execute(
            _entries(
                "campaign", kind, sizes, "campaigns JOIN structures s ON s.id = owner.structure_id"
            )
        )
    op.execute(_entries("structure", "curves", CURVES, "structures"))


def _entries(owner: str, kind: str, sizes: str, table: str) -> str:
    name, _, joined = table.partition(" ")
    project = "s.project_id" if joined else "owner.project_id"
    return f"""
        INSERT INTO stored_bytes (id, created_at, project_id, {owner}_id, kind, size)
        SELECT md5(owner.id::text || '{kind}')::uuid, owner.created_at, {project}, owner.id, '{kind}', total
        FROM (SELECT key, sum(size)::bigint AS total FROM ({sizes}) AS sizes (key, size) GROUP BY key) found
        JOIN {name} owner ON owner.id = found.key {joined}
        WHERE total > 0
    """


def downgrade() -> None:
    """Forget the account."""
    op.drop_table("stored_bytes")
