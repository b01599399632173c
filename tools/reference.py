"""Make what is made from code: the client's table of routes, and the pages of the reference.

python -m tools.reference            # writes
python -m tools.reference --check    # only says what is not as it should be; exit 1 then
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from tools import pages, routes

ROOT = Path(__file__).resolve().parent.parent
MADE: dict[str, Callable[[], str]] = {
    "modalbase/client/routes.json": routes.table,
    "docs/reference-rest.md": pages.rest_page,
    "docs/reference-cli.md": pages.cli_page,
}


def stale() -> list[str]:
    """Files that are not what the code makes of them."""
    return [name for name, make in MADE.items() if not _same(ROOT / name, make())]


def _same(path: Path, text: str) -> bool:
    return path.exists() and path.read_text(encoding="utf-8") == text


def main() -> int:
    """Write, or check."""
    if "--check" in sys.argv[1:]:
        for name in (found := stale()):
            print(f"{name} is not what the code makes: python -m tools.reference")
        return 1 if found else 0
    for name, make in MADE.items():
        text = make()
        (ROOT / name).parent.mkdir(parents=True, exist_ok=True)
        (ROOT / name).write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
