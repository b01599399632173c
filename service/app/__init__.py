"""How a service runs: the API, the worker, their supervisor, the command line, backup and the
demo.
"""
