"""Campaigns of few FRFs, whose arrays are smaller than the blocks that they are read in: each
figure, and the report.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from uuid import uuid4

import httpx
import pytest

from modalbase.client.connection import Connection
from modalbase.objects.campaigns import Campaign
from modalbase.objects.frfs import Frfs
from modalbase.objects.laboratory import Laboratory
from modalbase.objects.projects import Structure
from service.app.supervisor import LocalService
from service.pages.example import paper
from tests.support.lengths import long
from tests.support.rest import ok, plain_client

REPORTS = ("report?format=pdf",)
FORMATS = ("plotly", "svg", "png", "pdf")
SIZES = [long(*size, FORMATS, REPORTS) for size in product((1, 2, 3, 5, 12), (1, 2, 4, 8))]


SHORT = {"parameters": [{"name": "Ex"}, {"name": "Gxy"}], "damping_models": ["rayleigh"]}


@pytest.fixture(scope="module")
def client(service: LocalService) -> Iterator[httpx.Client]:
    with plain_client(
        service.url, {"Authorization": f"Bearer {service.new_key(f'few {uuid4()}')}"}
    ) as client:
        yield client


@pytest.fixture(scope="module")
def structure(client: httpx.Client) -> Structure:
    return Laboratory(Connection.over(client)).new_project("few").new_structure(**paper.STRUCTURE)


@pytest.fixture(scope="module")
def whole(structure: Structure, tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """The demonstration's campaign."""
    file = Path(tmp_path_factory.mktemp("few"), "paper_beam.uff")
    file.write_bytes(paper.uff_file())
    campaign = structure.new_campaign(**paper.CAMPAIGN)
    campaign.import_file(file)
    return campaign


@pytest.mark.parametrize(
    ("count", "stride", "formats", "reports"), [(1, 1, ["plotly"], []), *SIZES]
)
def test_every_figure_and_the_report(
    client: httpx.Client,
    structure: Structure,
    whole: Campaign,
    count: int,
    stride: int,
    formats: Sequence[str],
    reports: Sequence[str],
) -> None:
    """Of the first FRFs, every so many of their 1,000 lines; a report prints the same figures."""
    frfs, rest = whole.frfs(), whole.lab.rest
    few = structure.new_campaign(
        **paper.CAMPAIGN | {"name": f"{count} FRFs, every line of {stride}"}
    )
    rest.put_grid_points(few.fields["id"], body=rest.get_grid_points(whole.fields["id"]))
    few.add_frfs(
        Frfs(frfs.frequency_hz[::stride], frfs.values[:count, ::stride], frfs.frfs[:count])
    )
    typed = few.new_mode_set("Table 3", paper.MODES)
    job = few.update(SHORT, mode_set=typed).wait().check()
    path = f"/api/v1/update-jobs/{job.fields['id']}"
    names = [one["name"] for one in ok(client.get(f"{path}/figures"))["items"] if one["available"]]
    figures = [
        *(f"figures/{name}?format={kind}" for name in names for kind in formats),
        *reports,
    ]
    assert {"frf", "shapes"} <= set(names)
    assert {one: client.get(f"{path}/{one}").status_code for one in figures} == dict.fromkeys(
        figures, 200
    )
