"""Instruments of a project, with their calibrations; campaigns name them by kind and serial
number.
"""
