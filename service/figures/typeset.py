"""A document on paper: a template of Typst, what it says, figures as vectors, photographs.

It runs in a child process (`in_subprocess`): photographs are what a client sent, and neither
Typst nor matplotlib shall stay in the memory of the API. Nothing is fetched: fonts are those that
come with matplotlib, which the figures are lettered in too.
"""

import io
import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final, Literal

from service.figures.marks import Figure
from service.figures.paper import render

Form = Literal["html", "pdf"]
STANDARD: Final = "a-2a"  # PDF/A of tagged text: it reads aloud, and opens in fifty years
PHOTO_PIXELS = 1400  # of the longer side: 200 dpi over the width of a page
MOST_PIXELS = 100_000_000  # of a photograph: a packed one of a few kB may unfold to gigabytes


@dataclass(frozen=True)
class Document:
    """A document before it is set."""

    template: bytes  # of Typst. It reads `content.json`; `sys.inputs.form` says what it is for
    style: bytes  # of the page
    # what it says; `at`: when it was made, ISO 8601; `files` is added: names of photos there are
    content: Mapping[str, Any]
    figures: Mapping[str, Figure]  # drawn as `NAME.svg`
    photos: Mapping[str, bytes]  # PNG, JPEG or WebP, as `NAME.jpg` where they can be read


def typeset(document: Document, form: Form) -> bytes:
    """A page that stands alone, or A4 as PDF/A; the same input gives the same bytes."""
    import matplotlib
    import typst

    files = {
        f"{name}.jpg": photo for name, raw in document.photos.items() if (photo := _smaller(raw))
    }
    stated = json.dumps({**document.content, "files": list(files)}, allow_nan=False)
    files |= {
        f"{name}.svg": render(figure, "svg", letters=True)
        for name, figure in document.figures.items()
    }
    files |= {"main.typ": document.template, "content.json": stated.encode()}
    common: Any = {
        "font_paths": [str(Path(matplotlib.get_data_path(), "fonts/ttf"))],
        "ignore_system_fonts": True,
        "sys_inputs": {"form": form},
        "timestamp": int(datetime.fromisoformat(document.content["at"]).timestamp()),
    }
    with tempfile.TemporaryDirectory(prefix="modalbase-report-") as folder:
        for name, written in files.items():
            Path(folder, name).write_bytes(written)
        main = Path(folder, "main.typ")
        if form == "html":
            page: bytes = typst.compile(main, format="html", **common)
            # the policy of the page takes styles from its head alone
            page = page.replace(b' style="display: block"', b"")
            return page.replace(b"</head>", b"<style>%b</style></head>" % document.style, 1)
        printed: bytes
        try:
            printed = typst.compile(main, format="pdf", pdf_standards=[STANDARD], **common)
        except typst.TypstError:  # PDF/A refuses a sign that no font has, such as one of Chinese
            printed = typst.compile(main, format="pdf", **common)
        return printed


def _smaller(raw: bytes) -> bytes | None:
    """A photograph as upright JPEG without what the camera noted, such as the place; None where it
    cannot be read.
    """
    from PIL import Image, ImageOps, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(raw), formats=("PNG", "JPEG", "WEBP")) as image:
            if image.width * image.height > MOST_PIXELS:
                return None
            image.draft("RGB", (PHOTO_PIXELS, PHOTO_PIXELS))
            upright = ImageOps.exif_transpose(image).convert("RGBA")
    except (OSError, SyntaxError, ValueError, UnidentifiedImageError):
        return None
    upright.thumbnail((PHOTO_PIXELS, PHOTO_PIXELS))
    paper = Image.new("RGB", upright.size, "white")
    paper.paste(upright, mask=upright)
    written = io.BytesIO()
    paper.save(written, "JPEG", quality=85)
    return written.getvalue()
