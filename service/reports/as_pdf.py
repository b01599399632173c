"""A report as PDF, A4, with ReportLab: no browser and no system library.

The fonts are matplotlib's DejaVu, which have Greek letters and signs; they are embedded. The same
report gives the same bytes.
"""

import io
from collections.abc import Sequence
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

from service.figures.marks import Figure
from service.figures.paper import pixels
from service.reports.blocks import (
    Block,
    Bullets,
    Heading,
    Letterhead,
    PageBreak,
    Paragraph,
    Picture,
    Report,
    Signatures,
    Table,
)

MARGIN, WIDTH, HEIGHT = 51.0, 493.0, 745.0  # points, of the text; A4 is 595 by 842
PICTURE_DPI = 170
LOGO = 45.0  # points, height of a logo
_TONES = {
    "good": ("#00704e", "#eaf6f1"),
    "careful": ("#b35f00", "#fdf3e4"),
    "bad": ("#b00020", "#fbeaec"),
}
_SANS, _BOLD, _MONO = "DejaVuSans", "DejaVuSans-Bold", "DejaVuSansMono"


def as_pdf(report: Report) -> bytes:
    """The report as a PDF, with page numbers."""
    from reportlab import rl_config
    from reportlab.platypus import SimpleDocTemplate

    # pictures as bytes: as letters they are a quarter larger and took a quarter of the time
    rl_config.useA85 = 0
    _register_fonts()
    buffer = io.BytesIO()

    def foot(canvas: Any, document: Any) -> None:
        canvas.saveState()
        canvas.setFont(_SANS, 7)
        canvas.setFillGray(0.35)
        canvas.drawString(MARGIN, 28, report.footer)
        canvas.drawRightString(MARGIN + WIDTH, 28, f"page {document.page}")
        canvas.restoreState()

    document = SimpleDocTemplate(
        buffer, pagesize=(595.28, 841.89), leftMargin=MARGIN - 6, rightMargin=MARGIN - 6, topMargin=40, bottomMargin=44,
        title=report.title, author="modalbase", invariant=1,
    )  # fmt: skip
    parts = [part for block in report.blocks for part in _parts(block)]
    document.build(parts, onFirstPage=foot, onLaterPages=foot)
    return buffer.getvalue()


@cache
def _register_fonts() -> None:
    """Once a process; matplotlib brings the files."""
    import matplotlib
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    folder = Path(matplotlib.get_data_path()) / "fonts/ttf"
    for name in (_SANS, _BOLD, _MONO):
        pdfmetrics.registerFont(TTFont(name, str(folder / f"{name}.ttf")))


def _parts(block: Block) -> list[Any]:
    """A block as what ReportLab flows over pages."""
    from reportlab import platypus as flow

    match block:
        case Letterhead():
            return [_letterhead(block), flow.Spacer(1, 14)]
        case Heading(text, level):
            size = {1: 16.0, 2: 11.5}.get(level, 9.5)
            heading = flow.Paragraph(
                escape(text), _style(size, font=_BOLD, before=10 if level > 1 else 0, keep=True)
            )
            return [heading]
        case Paragraph(text, tone) if tone in _TONES:
            line, ground = _TONES[tone]
            return [
                flow.Paragraph(
                    escape(text), _style(9.5, line=line, ground=ground, before=4, after=8)
                )
            ]
        case Paragraph(text, "code"):
            return [
                flow.Paragraph(escape(line).replace(" ", "\u00a0"), _style(6, font=_MONO))
                for line in text.split("\n")
            ]
        case Paragraph(text, tone):
            return [flow.Paragraph(escape(text), _style(7.5 if tone == "small" else 8.5, after=3))]
        case Bullets(items):
            return [
                flow.Paragraph(escape(item), _style(8.5, bullet=True), bulletText="•")
                for item in items
            ]
        case Table():
            return [_table(block), flow.Spacer(1, 5)]
        case Picture(figure, width):
            return [_picture(figure, width * WIDTH)]
        case Signatures(roles):
            return [flow.Spacer(1, 34), _signatures(roles)]
        case PageBreak():
            return [flow.PageBreak()]


def _letterhead(block: Letterhead) -> Any:
    """Name and address at the left, the logo at the right, as high as three lines of it."""
    from reportlab import platypus as flow
    from reportlab.lib.utils import ImageReader

    words = [flow.Paragraph(escape(block.name), _style(10, font=_BOLD))]
    words += [flow.Paragraph(escape(line), _style(8)) for line in block.address]
    logo: Any = ""
    if block.logo is not None:
        across, up = ImageReader(io.BytesIO(block.logo)).getSize()
        height = min(LOGO, 0.4 * WIDTH * up / across)
        logo = flow.Image(io.BytesIO(block.logo), height * across / up, height, hAlign="RIGHT")
    drawn = flow.Table([[words, logo]], colWidths=[0.6 * WIDTH, 0.4 * WIDTH])
    drawn.setStyle([("ALIGN", (1, 0), (1, 0), "RIGHT"), ("VALIGN", (0, 0), (-1, -1), "TOP")])
    return drawn


def _picture(figure: Figure, width: float) -> Any:
    """A figure as a picture of so many points, narrower where it would be higher than the page. It
    goes from matplotlib's memory into the file without a PNG between them.
    """
    from PIL.Image import fromarray
    from reportlab.lib.utils import ImageReader
    from reportlab.platypus.flowables import Flowable

    picture = pixels(figure, PICTURE_DPI)
    width = min(width, HEIGHT * picture.shape[1] / picture.shape[0])
    height = width * picture.shape[0] / picture.shape[1]

    class Drawn(Flowable):  # type: ignore[misc]  # ReportLab has no types
        hAlign = "CENTER"

        def wrap(self, *_: Any) -> tuple[float, float]:
            return width, height

        def draw(self) -> None:
            self.canv.drawImage(ImageReader(fromarray(picture)), 0, 0, width, height)

    return Drawn()


def _style(
    size: float, *, font: str = _SANS, before: float = 0, after: float = 2, keep: bool = False, bullet: bool = False,
    line: str | None = None, ground: str | None = None, right: bool = False,
) -> Any:  # fmt: skip
    from reportlab.lib.colors import HexColor
    from reportlab.lib.enums import TA_LEFT, TA_RIGHT
    from reportlab.lib.styles import ParagraphStyle

    style = ParagraphStyle(
        "block", fontName=font, fontSize=size, leading=1.3 * size, spaceBefore=before, spaceAfter=after, keepWithNext=keep,
        alignment=TA_RIGHT if right else TA_LEFT, bulletFontName=_SANS, bulletFontSize=size, splitLongWords=1,
    )  # fmt: skip
    if bullet:
        style.leftIndent, style.bulletIndent = 10, 0
    if line is not None and ground is not None:
        style.backColor, style.borderColor, style.borderWidth, style.borderPadding = (
            HexColor(ground),
            HexColor(line),
            0.8,
            5,
        )
        style.leftIndent = style.rightIndent = 6
    return style


def _table(table: Table) -> Any:
    from reportlab import platypus as flow
    from reportlab.lib.colors import HexColor

    named = bool(table.columns)

    def cells(row: Sequence[str], font: str) -> list[Any]:
        pairs = zip(row, table.numeric, strict=True)
        return [
            flow.Paragraph(escape(text), _style(7.5, font=font, right=right))
            for text, right in pairs
        ]

    head = [cells(table.columns, _BOLD)] if named else []
    body = [cells(row, _SANS) for row in table.rows]
    drawn = flow.Table(
        head + body, colWidths=_widths(table), repeatRows=1 if named else 0, splitInRow=1
    )
    rules = [
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ("TOPPADDING", (0, 0), (-1, -1), 1.5),
        ("BOTTOMPADDING", (0, 0), (-1, -1), 1.5),
        ("LEFTPADDING", (0, 0), (-1, -1), 3),
        ("RIGHTPADDING", (0, 0), (-1, -1), 3),
        ("LINEBELOW", (0, 0), (-1, -1), 0.3, HexColor("#cccccc")),
    ]
    if named:
        rules.append(("LINEBELOW", (0, 0), (-1, 0), 0.8, HexColor("#444444")))
    drawn.setStyle(rules)
    return drawn


_PADDING = 2  # letters' widths of what a cell keeps free on both sides


def _widths(table: Table) -> list[float]:
    """By the longest text of each column, within limits, so that one long cell does not squeeze the
    others; a word is not broken.
    """
    rows = ([table.columns] if table.columns else []) + list(table.rows)
    lengths = [
        max(6, *(_length(row[k]) for row in rows)) + _PADDING for k in range(len(table.numeric))
    ]
    total = sum(lengths)
    return [WIDTH * length / total for length in lengths]


def _length(text: str) -> int:
    return max(min(len(text), 48), *map(len, text.split()), 0)


def _signatures(roles: Any) -> Any:
    from reportlab import platypus as flow
    from reportlab.lib.colors import black

    cells, widths, rules = [], [], []
    for k, role in enumerate(roles):
        cells += [flow.Paragraph(f"{escape(role)}, date", _style(7.5)), ""]
        widths += [0.9 * WIDTH / len(roles), 0.1 * WIDTH / len(roles)]
        rules.append(("LINEABOVE", (2 * k, 0), (2 * k, 0), 0.6, black))
    drawn = flow.Table([cells], colWidths=widths)
    drawn.setStyle(rules)
    return drawn
