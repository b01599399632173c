"""Jobs: our row is the truth, the queue only carries its id, the numbers are made in a child process.

What a feature needs of it::

    from service.jobs.kinds import JobKind
    from service.jobs.resource import JobNoun
    from service.jobs.routes import JobRoutes

    IDENTIFY = JobKind("identification", load=load, compute=find_modes, store=store)    # listed in service.app.kinds.KINDS
    IDENTIFICATIONS = JobNoun(IDENTIFY, identification_for, "identifications")          # its table: key = jobs.id

    row = IDENTIFICATIONS.start(session, user, Identification(campaign_id=campaign.id)) # in the request's transaction

    routes = JobRoutes(router, IDENTIFICATIONS, IdentificationOut, describe, "identification_id")
    routes.cancelling("cancel_identification", "Ask for an identification's end.")      # POST …/{id}/cancel

Nothing is imported here: the process that computations are forked from loads `child` and `kinds` without the database.
"""
