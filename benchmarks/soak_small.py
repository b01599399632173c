"""Small campaigns: `python -m benchmarks.soak_small`, a part of `make soak`.

The demonstration's beam with few FRFs on few lines, whose stored arrays are smaller than the blocks that they are read in. Of
each update every figure in every format, the report and its PDF are asked for.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import httpx

from modalbase.client.connection import Connection
from modalbase.objects.campaigns import Campaign
from modalbase.objects.frfs import Frfs
from modalbase.objects.laboratory import Laboratory
from service.app.demo import paper
from service.app.supervisor import LocalService
from service.settings import Settings

SIZES = tuple((frfs, stride) for frfs in (1, 2, 3, 5, 12) for stride in (1, 2, 4, 8))
"""FRFs, and which of their 1,000 lines."""
FORMATS = ("plotly", "svg", "png", "pdf")


def small_campaigns(
    client: httpx.Client, sizes: tuple[tuple[int, int], ...] = SIZES, formats: tuple[str, ...] = FORMATS
) -> Iterator[tuple[str, int]]:
    """Update the beam from each size of a campaign, and ask for all that can be looked at.

    Args:
        client: at the service's root, with a key.
        sizes: number of FRFs, and the stride of their lines.
        formats: of the figures.

    Yields:
        What was asked for, and the status of the answer.
    """
    lab = Laboratory(Connection.over(client))
    structure = lab.new_project("small campaigns").new_structure(**paper.STRUCTURE)
    whole = structure.new_campaign(**paper.CAMPAIGN)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "paper_beam.uff")
        file.write_bytes(paper.uff_file())
        whole.import_file(file)
    frfs, points = whole.frfs(), lab.rest.get_grid_points(whole.fields["id"])
    for count, stride in sizes:
        few = structure.new_campaign(**paper.CAMPAIGN | {"name": f"{count} FRFs, every line of {stride}"})
        lab.rest.put_grid_points(few.fields["id"], body=points)
        few.add_frfs(Frfs(frfs.frequency_hz[::stride], frfs.values[:count, ::stride], frfs.frfs[:count]))
        for asked, status in _looked_at(client, few, formats):
            yield f"{few.fields['name']}: {asked}", status


def _looked_at(client: httpx.Client, campaign: Campaign, formats: tuple[str, ...]) -> Iterator[tuple[str, int]]:
    modes = campaign.new_mode_set("Table 3", paper.MODES)
    path = f"/api/v1/update-jobs/{campaign.update(mode_set=modes).wait().check().fields['id']}"
    available = [one["name"] for one in client.get(f"{path}/figures").json()["items"] if one["available"]]
    asked = [f"figures/{name}?format={kind}" for name in available for kind in formats]
    for address in [*asked, "report?format=html", "report?format=pdf"]:
        yield address, client.get(f"{path}/{address}").status_code


def main() -> None:
    """Print what was refused or broke, and how many answers there were; exit 1 where one was bad."""
    with tempfile.TemporaryDirectory(prefix="modalbase-small-") as folder:
        settings = Settings(data=Path(folder), port=0, database_url=None, log_level="warning")
        with LocalService(settings) as service:
            headers = {"Authorization": f"Bearer {service.new_key('small')}"}
            with httpx.Client(base_url=service.url, headers=headers, timeout=120, trust_env=False) as client:
                answers = list(small_campaigns(client))
    bad = [answer for answer in answers if answer[1] != httpx.codes.OK]
    print("\n".join(f"{status}  {asked}" for asked, status in bad))
    print(f"{len(SIZES)} campaigns, {len(answers)} answers, {len(bad)} of them bad")
    sys.exit(1 if bad or not answers else 0)


if __name__ == "__main__":
    main()
