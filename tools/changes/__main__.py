"""`python -m tools.changes [NAME ...] [--table]`."""

import argparse
import sys

from tools.changes import CHANGES, CONTRIBUTING, contributing, show

if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__)
    names = [change.name for change in CHANGES]
    asked.add_argument("names", nargs="*", metavar="NAME", help=", ".join(names))
    asked.add_argument("--table", action="store_true", help="write the table of CONTRIBUTING.md")
    options = asked.parse_args()
    if unknown := set(options.names) - set(names):
        asked.error(f"no change is named {', '.join(sorted(unknown))}")
    if options.table:
        CONTRIBUTING.write_text(contributing(), encoding="utf-8")
        sys.exit()
    chosen = [change for change in CHANGES if change.name in (options.names or names)]
    sys.exit(not all(show(change) for change in chosen))
