"""What the database keeps, a room for each noun of the REST contract.

They are structures, campaigns, frfs, records, modes, coupons, imports, updates and monitors;
notifications are what monitors say to people outside, storage counts what all of them take, and
search finds it.

An operation has the caller's transaction as `session`, and `user` is who asks. Whoever may not see
a row gets `NotFound`, whoever may not change it `Forbidden` (`service.platform.access.Lookup`);
docstrings state what else is raised.
"""
