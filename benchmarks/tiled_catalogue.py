"""The questions of `docs/search.md` that Tiled's catalogue can be asked, put to it over the same
metadata.

Tiled keeps metadata as free JSON in a tree of nodes and joins nothing, so that what a question says
of campaigns must be in the metadata of each FRF. Its server runs in this process, which spares it a
network, over the database that it embeds, SQLite: on PostgreSQL it needs an extension, btree_gin,
that ours has not. A Python that has `tiled[all]` runs this file alone:

    MODALBASE_TILED=~/tiled/bin/python python -m benchmarks search
"""

import asyncio
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

FIELDS = {
    "campaigns": "name,structure.name,boundary,performed_at,temperature_c,hammer",
    "frfs": (
        "campaign.name,structure.name,quantity,response_point,reference_point,driving_point,sensor"
    ),
    "modes": "campaign.name,structure.name,number,frequency_hz,damping_ratio",
    "results": "campaign.name,structure.name,verdict,Ex",
}
"""What the catalogue has of each noun."""
QUESTIONS: list[tuple[str, list[tuple[str, str, Any]]]] = [
    ("campaigns", [("gt", "temperature_c", 25), ("like", "structure.name", "bridge%")]),
    ("frfs", [("eq", "driving_point", True), ("eq", "sensor", "4507")]),
    ("frfs", [("eq", "reference_point", 12), ("eq", "quantity", "accelerance")]),
    (
        "modes",
        [("ge", "frequency_hz", 24), ("le", "frequency_hz", 27), ("gt", "damping_ratio", 0.1)],
    ),
    ("results", [("lt", "Ex", 30e9), ("eq", "verdict", "usable")]),
    ("campaigns", [("ge", "performed_at", "2026-03-01"), ("lt", "performed_at", "2026-04-01")]),
]
"""The others of the page ask for a thing beside or below, such as a campaign with a mode below 5
Hz.
"""
TURNS, PAGE = 20, 100


def beside(folder: Path) -> None:
    """Print what Tiled takes, where it is installed, over the rows of each noun that a folder has
    as `{noun}.jsonl`.
    """
    python = os.environ.get("MODALBASE_TILED", sys.executable)
    if subprocess.run(
        [python, "-c", "import tiled.catalog"], capture_output=True, check=False
    ).returncode:
        print("Tiled is not installed; MODALBASE_TILED names a Python that has it")
        return
    subprocess.run([python, __file__, str(folder)], check=True)


def _nested(row: dict[str, Any]) -> dict[str, Any]:
    """A row as metadata: a name with a point is a path."""
    found: dict[str, Any] = {}
    for name, value in row.items():
        *path, last = name.split(".")
        inner = found
        for part in path:
            inner = inner.setdefault(part, {})
        inner[last] = value
    return found


async def _fill(uri: str, folder: Path) -> int:
    """Put all nodes into the catalogue's table by itself, without a request for each; the number of
    them.
    """
    from sqlalchemy import insert, text  # Tiled's; nothing of this is installed with modalbase
    from sqlalchemy.ext.asyncio import create_async_engine
    from tiled.catalog.orm import Node

    engine, nodes, count = create_async_engine(uri), Node.__table__, 0
    async with engine.begin() as connection:
        root = (
            await connection.execute(text("SELECT id FROM nodes WHERE parent IS NULL"))
        ).scalar_one()
        common = {"structure_family": "container", "specs": []}
        for noun in FIELDS:
            top = {"key": noun, "parent": root, "metadata": {}, **common}
            parent = (
                await connection.execute(insert(nodes).values(top).returning(nodes.c.id))
            ).scalar_one()
            lines = (folder / f"{noun}.jsonl").read_text().splitlines()
            rows = [
                {"key": str(n), "parent": parent, "metadata": _nested(json.loads(line)), **common}
                for n, line in enumerate(lines)
            ]
            await connection.execute(insert(nodes), rows)
            count += len(rows)
        await connection.execute(text("ANALYZE"))
    await engine.dispose()
    return count


def _condition(op: str, name: str, value: Any) -> Any:
    from tiled.queries import Comparison, Eq, Like

    return (
        Eq(name, value)
        if op == "eq"
        else Like(name, value)
        if op == "like"
        else Comparison(op, name, value)
    )


def _asked(nodes: Any, conditions: Sequence[tuple[str, str, Any]]) -> int:
    """The first page with its metadata, and the count."""
    for condition in conditions:
        nodes = nodes.search(_condition(*condition))
    assert all(node.metadata is not None for node in nodes.values().head(PAGE))
    return len(nodes)


def main(folder: str) -> None:
    """Fill a catalogue and print how long it takes over each question."""
    import tiled
    from tiled.catalog import from_uri
    from tiled.client import Context, from_context
    from tiled.server.app import build_app

    uri = f"sqlite+aiosqlite:///{folder}/catalogue.db"
    catalogue = from_uri(uri, init_if_not_exists=True, writable_storage=folder)
    with Context.from_app(build_app(catalogue)) as context:
        count = asyncio.run(_fill(uri, Path(folder)))
        client = from_context(context)
        print(
            f"Tiled {tiled.__version__}, {count} nodes, first page and count in its own process,"
            " p50 and p95 in ms"
        )
        for noun, conditions in QUESTIONS:
            found, times = 0, []
            for _ in range(TURNS + 1):
                start = time.perf_counter()
                found = _asked(client[noun], conditions)
                times.append(1000 * (time.perf_counter() - start))
            *_, last = ordered = sorted(times[1:])
            said = " AND ".join(f"{name} {op} {value}" for op, name, value in conditions)
            print(
                f"{ordered[TURNS // 2]:7.1f} {last:7.1f}  {noun}: {said}: {found} found", flush=True
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
