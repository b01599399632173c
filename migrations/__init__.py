"""Database migrations (Alembic), shipped with the distribution so that `modalbase db upgrade` needs
nothing else.
"""
