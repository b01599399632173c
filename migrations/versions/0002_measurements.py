"""Structures, campaigns, imports, grid points, FRFs, mode sets and coupons."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0002_measurements"
down_revision = "0001_foundations"
branch_labels = None
depends_on = None

INSTANT = sa.DateTime(timezone=True)
REAL: sa.Double[float] = sa.Double()

TABLES = (
    "coupons",
    "coupon_batches",
    "modes",
    "mode_sets",
    "frfs",
    "imports",
    "original_chunks",
    "originals",
    "grid_points",
    "campaigns",
    "structure_versions",
    "structures",
)


def identified() -> tuple[sa.Column, sa.Column]:  # type: ignore[type-arg]
    return (
        sa.Column("id", sa.Uuid(), server_default=sa.text("uuidv7()"), primary_key=True),
        sa.Column("created_at", INSTANT, server_default=sa.func.now(), nullable=False),
    )


def parent(table: str, column: str, *, primary_key: bool = False) -> sa.Column:  # type: ignore[type-arg]
    key = sa.ForeignKey(f"{table}.id", ondelete="CASCADE")
    return sa.Column(column, sa.Uuid(), key, nullable=False, primary_key=primary_key)


def upgrade() -> None:
    structures()
    campaigns()
    imports()
    frfs()
    mode_sets()
    coupons()


def downgrade() -> None:
    for table in TABLES:
        op.drop_table(table)
    op.execute("DROP FUNCTION refuse_change()")


def structures() -> None:
    op.create_table(
        "structures",
        *identified(),
        parent("projects", "project_id"),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("updated_at", INSTANT, server_default=sa.func.now(), nullable=False),
    )
    op.create_index(None, "structures", ["project_id", "id"])
    op.create_table(
        "structure_versions",
        *identified(),
        parent("structures", "structure_id"),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("length_m", REAL, nullable=False),
        sa.Column("width_m", REAL, nullable=False),
        sa.Column("thickness_m", REAL, nullable=False),
        sa.Column("density_kg_m3", REAL, nullable=False),
        sa.Column("laminate", JSONB()),
        sa.Column("material", JSONB()),
        sa.UniqueConstraint("structure_id", "number"),
    )
    # What a result used never changes under it, whoever writes to the database.
    op.execute(
        "CREATE FUNCTION refuse_change() RETURNS trigger LANGUAGE plpgsql AS "
        "$$ BEGIN RAISE EXCEPTION 'rows of % never change', TG_TABLE_NAME; END $$"
    )
    op.execute(
        "CREATE TRIGGER structure_versions_never_change BEFORE UPDATE ON structure_versions "
        "FOR EACH ROW EXECUTE FUNCTION refuse_change()"
    )


def campaigns() -> None:
    op.create_table(
        "campaigns",
        *identified(),
        parent("structures", "structure_id"),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("boundary", sa.String(), nullable=False),
        sa.Column("performed_at", INSTANT),
        sa.Column("temperature_c", REAL),
        sa.Column("humidity_percent", REAL),
        sa.Column("instruments", JSONB(), nullable=False),
        sa.Column("frame", JSONB()),
        sa.Column("notes", sa.String(), nullable=False),
        sa.Column("updated_at", INSTANT, server_default=sa.func.now(), nullable=False),
        sa.Column("deleted_at", INSTANT),
    )
    op.create_index(None, "campaigns", ["structure_id", "id"])
    op.create_table(
        "grid_points",
        parent("campaigns", "campaign_id", primary_key=True),
        sa.Column("label", sa.BigInteger(), primary_key=True, autoincrement=False),
        sa.Column("x_m", REAL, nullable=False),
        sa.Column("y_m", REAL, nullable=False),
        sa.Column("z_m", REAL, nullable=False),
    )


def imports() -> None:
    op.create_table(
        "originals",
        sa.Column("sha256", sa.LargeBinary(), primary_key=True),
        sa.Column("size", sa.BigInteger(), nullable=False),
        sa.Column("created_at", INSTANT, server_default=sa.func.now(), nullable=False),
    )
    op.create_table(
        "original_chunks",
        sa.Column(
            "sha256",
            sa.LargeBinary(),
            sa.ForeignKey("originals.sha256", ondelete="CASCADE"),
            primary_key=True,
        ),
        sa.Column("number", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
    )
    op.create_table(
        "imports",
        sa.Column("id", sa.Uuid(), sa.ForeignKey("jobs.id"), primary_key=True),
        parent("campaigns", "campaign_id"),
        sa.Column("filename", sa.String(), nullable=False),
        sa.Column("sha256", sa.LargeBinary(), sa.ForeignKey("originals.sha256"), nullable=False),
        sa.Column("dry_run", sa.Boolean(), nullable=False),
        sa.Column("quantity", sa.String()),
        sa.Column("counts", JSONB()),
        sa.Column("datasets", JSONB()),
        sa.Column("warnings", JSONB()),
    )
    op.create_index(None, "imports", ["campaign_id", "sha256"])


def frfs() -> None:
    op.create_table(
        "frfs",
        *identified(),
        parent("campaigns", "campaign_id"),
        sa.Column("import_id", sa.Uuid(), sa.ForeignKey("imports.id")),
        sa.Column("dataset", sa.Integer()),
        sa.Column("label", sa.String(), nullable=False),
        sa.Column("response_point", sa.BigInteger(), nullable=False),
        sa.Column("response_direction", sa.Integer(), nullable=False),
        sa.Column("reference_point", sa.BigInteger(), nullable=False),
        sa.Column("reference_direction", sa.Integer(), nullable=False),
        sa.Column("quantity", sa.String(), nullable=False),
        sa.Column("averages", sa.Integer()),
        sa.Column("start_hz", REAL, nullable=False),
        sa.Column("end_hz", REAL, nullable=False),
        sa.Column("step_hz", REAL),
        sa.Column("lines", sa.Integer(), nullable=False),
        sa.Column("dtype", sa.String(), nullable=False),
        sa.Column("sha256", sa.LargeBinary(), nullable=False),
        sa.Column("coherence_dtype", sa.String()),
        sa.Column("coherence_sha256", sa.LargeBinary()),
        sa.Column("axis", sa.LargeBinary()),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.Column("coherence", sa.LargeBinary()),
        sa.CheckConstraint("(step_hz IS NULL) = (axis IS NOT NULL)", "axis"),
    )
    op.create_index(None, "frfs", ["campaign_id", "id"])
    op.create_index(None, "frfs", ["campaign_id", "response_point", "id"])
    op.create_index(None, "frfs", ["import_id", "dataset"], unique=True)
    # Noise does not compress; out of line, a list of FRFs never touches a spectrum.
    for table, column in (
        ("frfs", "data"),
        ("frfs", "coherence"),
        ("frfs", "axis"),
        ("original_chunks", "data"),
    ):
        op.execute(f"ALTER TABLE {table} ALTER COLUMN {column} SET STORAGE EXTERNAL")


def mode_sets() -> None:
    op.create_table(
        "mode_sets",
        *identified(),
        parent("campaigns", "campaign_id"),
        sa.Column("import_id", sa.Uuid(), sa.ForeignKey("imports.id")),
        sa.Column("job_id", sa.Uuid(), sa.ForeignKey("jobs.id", ondelete="SET NULL")),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("origin", sa.String(), nullable=False),
        sa.Column("covariance", JSONB()),
        sa.Column("details", JSONB(), server_default=sa.text("'{}'"), nullable=False),
    )
    op.create_index(None, "mode_sets", ["campaign_id", "id"])
    op.create_table(
        "modes",
        parent("mode_sets", "mode_set_id", primary_key=True),
        sa.Column("number", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("frequency_hz", REAL, nullable=False),
        sa.Column("damping_ratio", REAL),
        sa.Column("frequency_sd_hz", REAL),
        sa.Column("damping_sd", REAL),
        sa.Column("shape", JSONB()),
    )


def coupons() -> None:
    op.create_table(
        "coupon_batches",
        *identified(),
        parent("structures", "structure_id"),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("constants", JSONB(), nullable=False),
        sa.Column("published", JSONB(), nullable=False),
        sa.Column("conditions", JSONB(), nullable=False),
    )
    op.create_index(None, "coupon_batches", ["structure_id", "id"])
    op.create_table(
        "coupons",
        *identified(),
        parent("coupon_batches", "batch_id"),
        sa.Column("specimen", sa.String(), nullable=False),
        sa.Column("standard", sa.String(), nullable=False),
        sa.Column("e_pa", REAL),
        sa.Column("g_pa", REAL),
        sa.Column("nu", REAL),
        sa.Column("strength_pa", REAL),
        sa.Column("ultimate_strain", REAL),
        sa.Column("failure_code", sa.String()),
        sa.Column("excluded", sa.Boolean(), nullable=False),
        sa.Column("exclusion_reason", sa.String()),
        sa.UniqueConstraint("batch_id", "specimen"),
        sa.CheckConstraint("excluded = (exclusion_reason IS NOT NULL)", "exclusion_reason"),
    )
