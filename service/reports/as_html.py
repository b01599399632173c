"""A report as one HTML file: figures inline as SVG, no script, nothing from elsewhere."""

import base64
import hashlib
from collections.abc import Sequence
from html import escape

from service.figures.paper import render
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

STYLE = """
body{font:15px/1.45 system-ui,sans-serif;font-variant-numeric:tabular-nums;color:#14171a;background:#fff;
max-width:50rem;margin:2rem auto;padding:0 1rem}
h1{font-size:1.6rem}
h2{font-size:1.2rem;margin-top:2rem;border-bottom:1px solid #ccc}
table{border-collapse:collapse;width:100%;margin:.6rem 0;font-size:.9rem}
th,td{text-align:left;padding:.2rem .5rem;border-bottom:1px solid #ddd;vertical-align:top}
th.n,td.n{text-align:right}
.scroll{overflow-x:auto}
.good,.careful,.bad{padding:.7rem 1rem;border-left:.4rem solid}
.good{border-color:#00704e;background:#eaf6f1}
.careful{border-color:#b35f00;background:#fdf3e4}
.bad{border-color:#b00020;background:#fbeaec}
.small{font-size:.8rem;color:#555}
pre{font-size:.75rem;white-space:pre-wrap;overflow-wrap:anywhere;background:#f6f6f6;padding:.7rem}
img{max-width:100%;display:block;margin:.5rem auto}
.head{display:flex;justify-content:space-between;gap:2rem;font-size:.9rem}
.head p{margin:0}
.head img{max-height:4rem;max-width:40%;margin:0}
.sign{display:flex;gap:2rem;margin-top:3rem}
.sign div{flex:1;border-top:1px solid #000;padding-top:.3rem}
td{overflow-wrap:break-word}
footer{margin-top:3rem;font-size:.8rem;color:#555}
@media print{
body{margin:0;max-width:none}
.page{break-before:page}
}
"""


POLICY = (
    "default-src 'none'; img-src data:; frame-ancestors 'self'; style-src 'sha256-"
    + base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
    + "'"
)
"""The page's Content-Security-Policy: its own style and pictures, and nothing else."""


def as_html(report: Report) -> bytes:
    """The report as a page that stands alone."""
    body = "\n".join(_block(block) for block in report.blocks)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(report.title)}</title><style>{STYLE}</style></head><body>\n{body}\n"
        f"<footer>{escape(report.footer)}</footer></body></html>\n"
    ).encode()


def _block(block: Block) -> str:
    match block:
        case Letterhead(name, lines, logo):
            address = "<br>".join(map(escape, lines))
            return (
                "<div"
                f' class="head"><p><strong>{escape(name)}</strong><br>{address}</p>{_logo(logo)}</div>'
            )
        case Heading(text, level):
            return f"<h{level}>{escape(text)}</h{level}>"
        case Paragraph(text, "code"):
            return f"<pre>{escape(text)}</pre>"
        case Paragraph(text, tone):
            return f'<p class="{tone}">{escape(text)}</p>'
        case Bullets(items):
            return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>"
        case Table():
            return _table(block)
        case Picture(figure, width):
            # As an image its ids and styles cannot meet those of another figure on the page.
            source = base64.b64encode(render(figure, "svg")).decode()
            title = escape(figure.title, quote=True)
            return (
                f'<img alt="{title}" width="{100 * width:.0f}%"'
                f' src="data:image/svg+xml;base64,{source}">'
            )
        case Signatures(roles):
            return (
                '<div class="sign">'
                + "".join(f"<div>{escape(role)}, date</div>" for role in roles)
                + "</div>"
            )
        case PageBreak():
            return '<div class="page"></div>'


def _logo(content: bytes | None) -> str:
    if content is None:
        return ""
    kind = "png" if content.startswith(b"\x89PNG") else "jpeg"
    return f'<img alt="" src="data:image/{kind};base64,{base64.b64encode(content).decode()}">'


def _table(table: Table) -> str:
    head = f"<thead>{_row('th', table.columns, table.numeric)}</thead>" if table.columns else ""
    rows = "".join(_row("td", row, table.numeric) for row in table.rows)
    return f'<div class="scroll"><table>{head}<tbody>{rows}</tbody></table></div>'


def _row(tag: str, cells: Sequence[str], numeric: Sequence[bool]) -> str:
    pairs = zip(cells, numeric, strict=True)
    inner = "".join(
        f"<{tag}{' class=n' if right else ''}>{escape(text)}</{tag}>" for text, right in pairs
    )
    return f"<tr>{inner}</tr>"
