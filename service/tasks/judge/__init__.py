"""Judgements: a monitor's series is judged, and its alarms follow."""
