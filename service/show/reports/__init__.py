"""Reports: a result in, a document of headings, tables and figures out; written as HTML or as PDF
without a browser.
"""
