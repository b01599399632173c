"""Revisions: the schema at `0055_sensitivities`, then `0056_…` …, each named after what it brings."""
