"""Who writes documents anew writes those of the long run too, or they would be found to differ there
when nobody knows why.
"""

import os

import pytest

from tests.support.golden import WRITE


def pytest_configure(config: pytest.Config) -> None:
    if os.environ.get(WRITE) == "write":
        config.option.markexpr = ""
