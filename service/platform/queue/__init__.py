"""Jobs: our row is the truth, the queue only carries its id, the numbers are made in a child
process.

What a feature needs of it::

    from service.platform.queue.resource import JobNoun from service.platform.queue.routes import JobRoutes

    # its table has the key jobs.id; its kind is listed in service.tasks.kinds.KINDS
    IDENTIFICATIONS = JobNoun("identifications", identification_for, load, find_modes, store)

    row = IDENTIFICATIONS.start(session, user, Identification(campaign_id=campaign.id)) # in the
    request's transaction

    routes = JobRoutes(router, IDENTIFICATIONS, IdentificationOut, "identification_id", own)
    routes.cancelling("cancel_identification", "Ask for an identification's end.")      # POST …/{id}/cancel

Nothing is imported here: the process that computations are forked from loads `child` and `kinds`
without the database.
"""
