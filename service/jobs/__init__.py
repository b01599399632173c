"""Jobs: our row is the truth, the queue only carries its id, the numbers are made in a child process.

What a feature needs of it::

    from service.jobs.kinds import JobKind
    from service.jobs.queue import enqueue
    from service.jobs.resource import job_state

    IMPORT = JobKind("import", load=load, compute=parse_file, store=store)     # listed in service.app.kinds.KINDS

    job = enqueue(session, kind=IMPORT, project_id=project.id)                 # in the request's transaction
    session.add(Import(id=job.id, ...))                                        # its own table: key = jobs.id
    return {**job_state(job), ...}                                             # what GET answers

Nothing is imported here: the process that computations are forked from loads `child` and `kinds` without the database.
"""
