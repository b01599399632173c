"""What the database keeps, a room for each noun of the REST contract.

They are structures, campaigns, frfs, records, modes, coupons, imports, updating and plans; storage counts what
all of them take.
"""
