"""The measurement database and the service around the core: REST, jobs, storage."""
