"""Kinds of job, a folder each: `compute.py`, which the child process runs, and `task.py`, which says
what goes in, what is stored and how it is shown; `routes.py` and `page.html` where it has more to
show than every kind has.

Nothing is imported here: the child process loads `compute` alone.
"""
