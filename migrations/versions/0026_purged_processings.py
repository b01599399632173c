"""A project with processings can be purged: its jobs may go before the processings that they are
of.
"""

from alembic import op

revision = "0026_purged_processings"
down_revision = "0025_one_door"
branch_labels = None
depends_on = None

_NAME = "fk_processings_id_jobs"


def upgrade() -> None:
    """Let the reference wait until the purge has ended, as those of the other kinds of job do."""
    op.execute(f"ALTER TABLE processings ALTER CONSTRAINT {_NAME} DEFERRABLE")


def downgrade() -> None:
    """Check it at once."""
    op.execute(f"ALTER TABLE processings ALTER CONSTRAINT {_NAME} NOT DEFERRABLE")
