"""The command `modalbase`: running a service, its database, its care; and the client's commands beside them."""

from service.cli.command import main

__all__ = ["main"]
