"""Forecasts: jobs that solve a structure's nominal model before anything is measured."""
