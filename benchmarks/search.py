"""How search grows, at sizes of one embedded database: 100 campaigns have 10⁴ FRFs, 10,000 have
10⁶, and 10⁵ results.
"""

import re
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from uuid import UUID

import httpx
import numpy as np
import psycopg

from benchmarks.clock import timed
from benchmarks.service import Cost, api_of, contents, ended, measured, served
from benchmarks.tables import Table, load
from benchmarks.tiled_catalogue import FIELDS, beside
from modalbase.formats.uff.write import write_file
from service.app.supervisor import LocalService
from service.platform.db.engine import psycopg_url
from tests.support.rest import campaigns_of, posted

PAGE = (Path(__file__).parents[1] / "docs/search.md").read_text(encoding="utf-8")
QUESTIONS = re.findall(r"^\| [^|]+ \| `(\w+)` \| `([^`]+)` \|$", PAGE, re.MULTILINE)
"""Noun and filter of each question in the documents."""
SIZES = 100, 1000
TURNS, IMPORTS, IMPORTED, LINES = 40, 3, 2000, 32
# campaigns of a structure; FRFs and modes of a campaign, and results of ten
CAMPAIGNS_OF_A_STRUCTURE, EACH = 20, 100

FILL = """
SET LOCAL session_replication_role = replica;
INSERT INTO structures (project_id, name, version)
  SELECT '{project}', (ARRAY['bridge', 'panel', 'bar', 'mast'])[1 + i % 4] || ' ' || i, 1
  FROM generate_series(1, {structures}) i;
CREATE TEMP TABLE added ON COMMIT DROP AS SELECT uuidv7() AS id, s.id AS structure_id, i
  FROM (SELECT id FROM structures WHERE project_id = '{project}' ORDER BY id DESC LIMIT {structures}) s,
    generate_series(1, {campaigns}) i;
INSERT INTO campaigns (id, structure_id, name, boundary, performed_at, temperature_c, instruments, notes)
  SELECT id, structure_id, 'test ' || i, (ARRAY['free', 'cantilever'])[1 + i % 2],
    timestamptz '2025-01-01' + i * interval '7 days', random(-10.0, 40.0),
    jsonb_build_object('hammer', jsonb_build_object('model', '8206-002'),
                       'sensor', jsonb_build_object('model', (4500 + i % 20)::text, 'serial', i::text)), ''
  FROM added;
INSERT INTO instruments (project_id, kind, serial, model, notes, calibrations)
  SELECT '{project}', 'sensor', i::text, '', '', jsonb_build_array(jsonb_build_object('performed_on', '2024-12-01',
    'valid_until', CASE WHEN i = 7 THEN '2024-12-31' ELSE '2026-12-31' END))
  FROM generate_series(1, {campaigns}) i ON CONFLICT DO NOTHING;
SELECT state_uses(ARRAY(SELECT id FROM added));
INSERT INTO frfs (campaign_id, label, response_point, response_direction, reference_point, reference_direction, quantity,
    start_hz, end_hz, step_hz, lines, dtype, sha256, data)
  SELECT id, 'f', k, 3, 1 + floor(random() * 3000), 3, 'accelerance', 0, 31, 1, 32, '<c8', '', {spectrum}
  FROM added, generate_series(1, {frfs}) k ORDER BY id, k;
INSERT INTO mode_sets (campaign_id, name, origin) SELECT id, 'set', 'identified' FROM added;
INSERT INTO modes (mode_set_id, number, frequency_hz, damping_ratio)
  SELECT s.id, k, random(6.0, 4000.0), random(0.001, 0.2)
  FROM mode_sets s JOIN added ON added.id = s.campaign_id, generate_series(1, {modes}) k;
CREATE TEMP TABLE updated ON COMMIT DROP AS SELECT uuidv7() AS id, added.id AS campaign_id
  FROM added, generate_series(1, {results}) k;
INSERT INTO update_jobs (id, project_id, campaign_id, structure_version_id, recipe, campaigns)
  SELECT id, '{project}', campaign_id, campaign_id, '{{}}', '[]' FROM updated;
INSERT INTO update_results (id, campaign_id, verdict, ex, ex_low, ex_high, ey, document, prediction)
  SELECT id, campaign_id,
    (ARRAY['usable', 'with_care'])[1 + (random() < 0.3)::int], ex, 0.9 * ex, 1.1 * ex, 0.4 * ex, '{{}}', ''
  FROM (SELECT id, campaign_id, 3e10 * random({softest}, 2.0) AS ex FROM updated)
"""
"""What many campaigns leave, without what nobody searches; keys that refer to nothing are not
looked at. The FRFs of a campaign lie side by side, as an import writes them.
"""


def filling(
    project: UUID | str, structures: int, softest: float = 0.9, **each: object
) -> Iterator[str]:
    """The statements of a transaction that adds rows to a project.

    Args:
        project: its id.
        structures: how many.
        softest: the least Ex over 30 GPa.
        each: campaigns of a structure; `frfs`, `modes`, `results` of a campaign; `spectrum` in SQL.
    """
    yield from FILL.format(project=project, structures=structures, softest=softest, **each).split(
        ";\n"
    )


def search(*campaigns: int) -> list[str]:
    """The questions of `docs/search.md` over HTTP, and an import, as the database grows; gives what
    was too slow.
    """
    slow: list[str] = []
    with (
        served() as service,
        api_of(service) as api,
        tempfile.TemporaryDirectory(prefix="mb-") as folder,
    ):
        project, there, file = (
            str(posted(api, "projects", {"name": "all"})["id"]),
            0,
            Path(folder, "frfs.uff"),
        )
        write_file(file, contents(IMPORTED, LINES), binary=True)
        empty = _imported(api, service, file)
        print(
            f"{len(QUESTIONS)} questions, first page and counts over HTTP, {TURNS} times; {load()}"
        )
        for count in campaigns or SIZES:
            _fill(service, project, (count - there) // CAMPAIGNS_OF_A_STRUCTURE)
            there = count
            title = f"\n{EACH * count} FRFs, {EACH * count} modes, {EACH // 10 * count} results"
            table = Table(
                title, "p50 ms:.1f", "p95 ms:.1f", "processors ms:.1f", "noun:10", "question:80"
            )
            for noun, question in QUESTIONS:
                with measured(service) as cost:
                    times = _times(partial(_ask, api, noun, question))
                middle, most = np.percentile(times, (50, 95))
                busy = 1000 * cost.processor / (TURNS + 1)
                table.row(middle, most, busy, noun, question)
                slow += (
                    [f"{noun}: {question}: p95 {most:.0f} ms at {count} campaigns"]
                    if most > 100
                    else []
                )
            if count == (campaigns or SIZES)[0]:
                _beside(api, Path(folder))
            now = _imported(api, service, file)
            print(
                f"import of {IMPORTED} FRFs: {_per_second(now)}; into an empty service"
                f" {_per_second(empty)}"
            )
    return slow


def _ask(api: httpx.Client, noun: str, question: str) -> None:
    api.get(f"search/{noun}", params={"filter": question}).raise_for_status()


def _beside(api: httpx.Client, folder: Path) -> None:
    """The same rows and questions by Tiled's catalogue."""
    for noun, fields in FIELDS.items():
        answer = api.get(
            f"search/{noun}", params={"fields": fields, "format": "jsonl"}
        ).raise_for_status()
        (folder / f"{noun}.jsonl").write_bytes(answer.content)
    beside(folder)


def _times(call: Callable[[], None]) -> list[float]:
    call()
    return [1000 * float(timed(call)[1][0]) for _ in range(TURNS)]


def _fill(service: LocalService, project: str, structures: int) -> None:
    each = {
        "campaigns": CAMPAIGNS_OF_A_STRUCTURE,
        "frfs": EACH,
        "modes": EACH,
        "results": EACH // 10,
    }
    with psycopg.connect(psycopg_url(service.settings.database_url), autocommit=True) as connection:
        with connection.transaction():
            spectrum = "decode(repeat('00', 256), 'hex')"
            for statement in filling(project, structures, 0.5, spectrum=spectrum, **each):
                connection.execute(statement.encode())
        connection.execute("VACUUM ANALYZE")
        connection.execute("CHECKPOINT")


def _imported(api: httpx.Client, service: LocalService, file: Path) -> Cost:
    """The import that takes the processors least; the first, which warms up, does not count."""
    costs = []
    for campaign in campaigns_of(api, "imports", IMPORTS + 1):
        with measured(service) as cost:
            ended(api, api.post(f"campaigns/{campaign}/imports", content=file.read_bytes()))
        costs.append(cost)
    return min(costs[1:], key=lambda cost: cost.processor)


def _per_second(cost: Cost) -> str:
    return (
        f"{IMPORTED / cost.clock:.0f} FRFs/s by the clock, {IMPORTED / cost.processor:.0f} by the"
        " processors"
    )
