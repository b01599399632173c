"""Monitors: what is watched of a structure, its series of runs, judgements, alarms."""
