"""Imports: an uploaded file, kept as it came, and what it brought into its campaign."""
