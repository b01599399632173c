"""A laboratory's session with the service, through the library that its scripts use: REST, and nothing else."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from modalbase.client.connection import Connection
from modalbase.client.jobs import Watch
from modalbase.objects import laboratory
from service.app.demo import paper


@dataclass
class Laboratory:
    """A client of the service that notes how long each step took.

    Attributes:
        client: with the service's URL as base, and a key.
        durations: seconds by step.
    """

    client: httpx.Client
    durations: dict[str, float] = field(default_factory=dict)

    def update_beam(self, watch: Watch | None = None) -> dict[str, Any]:
        """The whole main job: from nothing to the result document.

        Args:
            watch: called with the stage and the share that is done while a job runs.

        Raises:
            ClientError: a call was refused, or a job failed.
        """
        lab = laboratory.Laboratory(Connection.over(self.client))
        with self._step("project, structure, campaign"):
            structure = lab.new_project("demonstration").new_structure(**paper.STRUCTURE)
            campaign = structure.new_campaign(**paper.CAMPAIGN)
        with self._step("import of 33 FRFs"), tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "paper_beam.uff")
            file.write_bytes(paper.uff_file())
            campaign.import_file(file, wait=False).wait(watch).check()
        with self._step("modes and coupons"):
            modes = campaign.new_mode_set("Table 3", paper.MODES)
            published = {name: {"mean": mean} for name, mean in paper.COUPONS_PA.items()}
            batch = structure.new_coupon_batch("Table 4", list(paper.COUPONS_PA), published=published)
        with self._step("update job"):
            job = campaign.update(mode_set=modes, prior_from_coupon_batch=batch).wait(watch)
            return dict(job.result().document)

    @contextmanager
    def _step(self, name: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self.durations[name] = time.perf_counter() - began
