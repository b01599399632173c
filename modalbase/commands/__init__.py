"""The commands that talk to a service, each written on the library's objects as a script is: what is
typed becomes calls of a laboratory and its things, and what they answer is printed. The module of a
command imports those below it in this list alone:

app           the commands, ready to be added to the application; `login`
exporting     files of the service
searching     `find`: rows over all projects, trends
watching      `watch`: files that appear in folders
updating      updates, their results, monitors, alarms
measuring     files, points, hits, FRFs, modes of a campaign
inventory     projects, structures and their models, campaigns, coupons
options       what they have in common
"""
