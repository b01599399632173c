"""Notifications: an outbox, and what sends from it to webhooks and by mail. It takes values, and
knows no monitor.
"""
