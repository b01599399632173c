"""Users' finite element models: read in a child process, kept as arrays, made into bodies of the
core.
"""
