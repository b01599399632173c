"""The guide below `/guide`: the pages of `docs`, which the wheel carries, as HTML without scripts
that asks no other host.
"""
