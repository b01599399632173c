"""Kinds of job, a folder each: `compute.py`, which the child process runs, and `task.py`, which says
what goes in, what is stored and how it is shown; `routes.py` and `page.html` where it has more to
show than every kind has.

A folder without `task.py` is computed while its request waits, and nothing of it is stored.
Nothing is imported here: the child process loads `compute` alone.
"""
