"""One consistent file of everything that the database holds, its restoration, and the check of what
is stored.
"""
