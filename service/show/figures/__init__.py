"""Figures: a result in, a `Figure` of marks out. No web, no database.

Each figure is described once, with the marks of `marks`. `screen` makes Plotly's JSON of it for the
browser, a notebook (`plotly.io.from_json`) and REST; `paper` draws it with matplotlib as SVG, PNG
or PDF.
"""
