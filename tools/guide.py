"""The guide as files that a browser opens without a service: `python -m tools.guide [FOLDER]`,
`build/guide` by default.
"""

import shutil
import sys
from pathlib import Path

from service.pages.guide.contents import PICTURES, addresses, files, whole_page
from service.pages.guide.routes import LINKED
from service.pages.look import FOLDER as STATIC

ROOT = Path(__file__).resolve().parent.parent


def write(folder: Path) -> list[Path]:
    """Write every page, picture and style sheet; the pages' files."""
    for style in LINKED:
        (folder / "static").mkdir(parents=True, exist_ok=True)
        shutil.copy(STATIC / style, folder / "static" / style)
    for name, file in files().items():
        if file.suffix in PICTURES:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, folder / name)
    pages = {folder / address: _page(address) for address in addresses()}
    for path, html in pages.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(html, encoding="utf-8")
    return list(pages)


def _page(address: str) -> str:
    html = whole_page(
        address,
        "../" * address.count("/"),
        tuple(f"static/{style}" for style in LINKED),
        service=False,
        search=False,
    )
    assert html is not None, address
    return html


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build/guide"
    print(f"{len(write(target))} pages in {target}")
