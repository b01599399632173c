"""Attachments: photographs, drawings and notes beside projects, structures, campaigns, updates and
monitors.
"""
