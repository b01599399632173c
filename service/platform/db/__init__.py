"""The database: engine, embedded server, base of the tables, schema."""
