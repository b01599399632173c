"""Revisions: `0001_foundations`, `0002_…` …, each named after what it brings."""
