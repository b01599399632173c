"""HTTP beneath the library's objects, and how what they answer is shown. In the order of the data:

endpoint      which service, with which key
connection    HTTP: pages, uploads, downloads, refusals
rest          each route of the contract as a method
errors        what stops a call, and the exit code of a command
display       tables and bars; `results`: results and mode sets in a laboratory's units

Nothing but `modalbase.objects` asks `connection` and `rest`; neither database nor core is imported,
so that a script's call starts fast.
"""
