"""How monitors and alarms are found."""

from __future__ import annotations

from service.access import Lookup
from service.monitoring.tables import Alarm, Monitor
from service.store.structures.operations import structure_for

monitor_for = Lookup(Monitor, "monitor", "structure_id", structure_for)
"""The monitor, if the user has at least a role in its project."""

alarm_for = Lookup(Alarm, "alarm", "monitor_id", monitor_for)
"""The alarm, if the user has at least a role in its project; none of a deleted monitor."""
