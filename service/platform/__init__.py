"""What everything else in the service stands on, each room on those before it.

Settings, errors and logs; db, the database; web, what all routes share; access, who may do what;
queue, the jobs.
"""
