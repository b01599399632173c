"""The command `modalbase`: running a service, its database, its care; and the client's commands
beside them.
"""

import sys

__all__ = ["main"]


def main() -> None:
    """Run the command. Ctrl-C while it is being loaded ends it as quietly as later."""
    try:
        from service.app.cli.command import main as run

        run()
    except KeyboardInterrupt:
        sys.exit(130)
