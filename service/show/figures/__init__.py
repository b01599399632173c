"""Figures: a result in, a Plotly figure out as plain JSON; and the same figure drawn for print. No web, no database.

Each figure is built once. The browser, a notebook (`plotly.io.from_json`) and REST show that JSON; `printing` draws the
same JSON with matplotlib as SVG, PNG or PDF.
"""
