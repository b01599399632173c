"""Finite element model updating in two stages: elastic constants from modes, then damping from
FRFs.
"""
