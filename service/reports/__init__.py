"""What is made of a result: figures, a report, predicted FRFs, decks for other solvers.

A report is a document of `blocks`: headings, tables and figures; it is written as HTML or as PDF.
"""
