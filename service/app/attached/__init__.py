"""`python -m service.app.attached serve|worker DESCRIPTOR`: a process that the supervisor starts,
with settings from the environment. It is the command of that name without the command line, which
would take a tenth of the start to load.

The descriptor is of the socket that the API listens on, or of what a worker writes to when it takes
jobs.
"""
