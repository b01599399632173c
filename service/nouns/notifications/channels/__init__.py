"""Channels of alarms, each a module with its `check` and `send`."""

from service.nouns.notifications.channels.channel import Channel
from service.nouns.notifications.channels.mail import MAIL
from service.nouns.notifications.channels.webhook import WEBHOOK

CHANNELS: dict[str, Channel] = {channel.name: channel for channel in (WEBHOOK, MAIL)}
"""Every channel, by its name. A new one is named here and nowhere else."""

OF_MONITORS = {
    channel.member: channel for channel in CHANNELS.values() if channel.member is not None
}
"""Those whose addresses a monitor states, by its member."""
