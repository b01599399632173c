"""Imports: an uploaded file is read into its campaign."""
