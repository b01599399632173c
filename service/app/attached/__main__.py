"""What `python -m service.app.attached` runs. As it has this name, the worker's children do not
load it.
"""

import os
import sys
from functools import partial

from service.app.cli.ending import ending
from service.app.serving import serve, work


def main() -> None:
    """Run it; what goes wrong on purpose is one line on standard error."""
    from service.platform.settings import Settings

    name, descriptor = sys.argv[1], int(sys.argv[2])
    with ending():
        if name == "serve":
            serve(Settings, descriptor, attached=True)
        else:
            work(Settings, ready=partial(_report, descriptor), attached=True)


def _report(descriptor: int) -> None:
    os.write(descriptor, b"1")


main()
