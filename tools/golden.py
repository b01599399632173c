"""Make the golden documents anew, as `tests/support/golden.py` compares them, and print what is different.

python -m tools.golden                # all
python -m tools.golden -k paper       # those of the tests that pytest's words choose
"""

import os
import sys

import pytest

from tests.support.golden import WRITE


def main() -> int:
    """Write what is not as it was; the number of pytest's exit."""
    os.environ[WRITE] = "write"
    return int(pytest.main(["tests/golden", "-q", "-s", *sys.argv[1:]]))


if __name__ == "__main__":
    sys.exit(main())
