"""The study of Mondal and Chakraborty (2015), ours beside theirs:
`python -m examples.paper [simulated cantilever free]`.
"""

import sys

from examples.paper import cantilever, free_beam, simulated_beam

PARTS = {
    "simulated": simulated_beam.report,
    "cantilever": cantilever.report,
    "free": free_beam.report,
}

if __name__ == "__main__":
    unknown = set(sys.argv[1:]) - set(PARTS)
    if unknown:
        sys.exit(f"no part named {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    for name in sys.argv[1:] or PARTS:
        PARTS[name]()
