"""The command line's client of the REST interface, and the HTTP beneath the library's objects.

It knows the service by HTTP alone, and imports neither the database nor the core, so that a
script's call starts fast. In the order of the data:

place         which service, with which key
connection    HTTP: pages, uploads, downloads, refusals; `rest`: each route of the contract as a method
finding       ids by name; `jobs`: waiting for their end; `files`: to the service and from it
inventory     commands for projects, structures and their models, campaigns, coupons
measuring     commands for files, points, hits, FRFs, modes
updating      commands for updates, their results, monitors, alarms
exporting     commands for files of the service
app           these commands, ready to be added to the application
"""
