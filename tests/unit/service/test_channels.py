"""Every channel of alarms is whole: listed, with its check and send, and documented."""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest

from service.nouns.monitors.schemas import MonitorIn, MonitorOut, MonitorPatch
from service.nouns.notifications import channels
from service.nouns.notifications.addresses import AddressError
from service.nouns.notifications.channels import CHANNELS, OF_MONITORS
from service.nouns.notifications.channels.channel import Channel, Receiver
from service.nouns.notifications.tables import Delivery
from service.platform.settings import Settings
from tests.support.waiting import completed

DOCUMENT = Path(__file__).parents[3] / "docs/monitoring.md"
BODY = '{"timestamp": "2026-01-02T03:04:05+00:00", "data": {"structure": {"name": "s", "id": "1"}, '
BODY += '"monitor": {"name": "m", "id": "2", "state": "no data"}}}'


def made() -> Iterator[tuple[str, Channel]]:
    """Channels of the folder's modules."""
    for module in iter_modules(channels.__path__):
        if module.name != "channel":
            of_module = vars(import_module(f"{channels.__name__}.{module.name}")).values()
            yield from ((module.name, one) for one in of_module if isinstance(one, Channel))


def test_every_module_of_a_channel_is_listed() -> None:
    modules = {module.name for module in iter_modules(channels.__path__)} - {"channel"}
    assert modules == {name for name, _ in made()}, "a module without a Channel"
    left_out = [name for name, channel in made() if CHANNELS.get(channel.name) is not channel]
    assert not left_out, f"not in CHANNELS of channels/__init__.py: {left_out}"


@pytest.mark.parametrize("member", OF_MONITORS)
def test_addresses_of_a_channel_are_documented_and_stated(member: str) -> None:
    assert f"| `{member}` |" in DOCUMENT.read_text(), f"docs/monitoring.md has no row of {member}"
    assert OF_MONITORS[member].meaning, f"{member} has no meaning"
    for model in (MonitorIn, MonitorPatch, MonitorOut):
        assert member in model.model_fields


@pytest.mark.parametrize("channel", CHANNELS.values(), ids=lambda channel: channel.name)
def test_a_channel_refuses_and_never_raises(channel: Channel) -> None:
    with pytest.raises(AddressError):
        channel.check("no address", Settings())
    delivery = Delivery(message_id="msg_1", event="monitor.no_data", body=BODY)
    outcome = completed(channel.send(delivery, Receiver("no address"), Settings()))
    assert outcome.error
