"""The command line's client of the REST interface: `import`, `campaigns`, `frfs`, `coupons`, `update`, `result`, `export`.

It knows the service by HTTP alone, and imports neither the database nor the core, so that a script's call starts fast.
"""
