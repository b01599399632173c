"""Condition monitoring: one frozen recipe run on every new campaign of a structure, its series
judged, alarms announced.

Data flows one way: campaigns that are complete -> runs (update jobs) -> series -> judgement ->
alarms -> deliveries. Nothing here waits for an event to come through: the scheduler compares what
is with what should be, and mends the difference, so a process that dies in between loses nothing
and does nothing twice.
"""
