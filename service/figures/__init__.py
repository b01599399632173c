"""Figures: a result in, a `Figure` of marks out.

Each figure is described once, with the marks of `marks`, without web or database. `screen` makes
Plotly's JSON of it for the browser, a notebook (`plotly.io.from_json`) and REST; `paper` draws it
with matplotlib as SVG, PNG or PDF. `measured` and `routes` draw what is stored.
"""
