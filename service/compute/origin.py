"""Where and with what a result was computed."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from typing import Any

import numpy as np

import fecore


def origin() -> dict[str, Any]:
    """Versions, host and time, for the provenance of a result."""
    return {
        "software": {"modalbase": fecore.__version__, "numpy": np.__version__, "python": platform.python_version()},
        "host": platform.node(),
        "computed_at": datetime.now(UTC).isoformat(),
    }
