"""Jobs: our row is the truth, the queue only carries its id, the numbers are made in a child process.

What a feature needs of it::

    from service.jobs import Job, JobKind, enqueue, job_state

    IMPORT = JobKind("import", load=load, compute=parse_file, store=store)     # listed in service.composition.KINDS

    job = enqueue(session, kind=IMPORT, project_id=project.id)                 # in the request's transaction
    session.add(Import(id=job.id, ...))                                        # its own table: key = jobs.id
    return {**job_state(job), ...}                                             # what GET answers
"""

from service.jobs.kinds import JobKind, Report
from service.jobs.queue import enqueue, one_at_a_time, request_cancel, retry
from service.jobs.state import job_state
from service.jobs.tables import Job

__all__ = ["Job", "JobKind", "Report", "enqueue", "job_state", "one_at_a_time", "request_cancel", "retry"]
