"""The demonstration: the paper's beam through a running service, by REST alone."""
