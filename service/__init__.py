"""The measurement database and the service around the core: REST, jobs, storage."""

import os

# Pydantic looks for plugins in every package that is installed, each time that a process starts;
# the service has none.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
