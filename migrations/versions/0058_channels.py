"""Channels of alarms: a monitor's receivers by channel, and the channel of each message."""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0058_channels"
down_revision = "0057_superseded"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Keep mail addresses as receivers of the channel mail, and say which way each message went."""
    op.add_column("monitors", sa.Column("receivers", JSONB()))
    op.execute("UPDATE monitors SET receivers = jsonb_build_object('mail', mail_to)")
    op.alter_column("monitors", "receivers", nullable=False)
    op.drop_column("monitors", "mail_to")
    op.add_column("deliveries", sa.Column("channel", sa.String()))
    op.execute(
        "UPDATE deliveries SET channel = CASE WHEN webhook_id IS NULL THEN 'mail' ELSE 'webhook' END"
    )
    op.alter_column("deliveries", "channel", nullable=False)
