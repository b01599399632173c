"""Imports: an uploaded file, kept as it came, and the job that reads it into a campaign."""
