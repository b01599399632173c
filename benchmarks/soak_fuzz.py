"""Fuzzing from the OpenAPI document: `python -m benchmarks.soak_fuzz [MINUTES]`, a part of `make soak`.

Schemathesis draws requests for every operation, right and wrong ones. What a path names is taken from what exists: at first
one thing of each kind, then also what the requests themselves have made, so that they meet things in every state. No answer
may be an error of the service, or one that the document does not know: status, content type, headers and body are held
against it.
"""

from __future__ import annotations

import random
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import schemathesis
from hypothesis import HealthCheck, Phase, given, seed, settings
from schemathesis.checks import not_a_server_error
from schemathesis.core.failures import FailureGroup
from schemathesis.core.result import Ok
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from benchmarks.access_laboratory import ASKED_FREELY, furnish
from service.app.supervisor import LocalService
from service.db.engine import make_engine, make_sessions
from service.settings import Settings

MINUTES = 10.0
SEED = 14
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]
NEWEST = 20  # things of a kind that paths name
PREFIX = "/api/v1/"
KINDS = {
    "projects": "project_id",
    "structures": "structure_id",
    "campaigns": "campaign_id",
    "imports": "import_id",
    "records": "record_id",
    "processings": "processing_id",
    "mode-sets": "mode_set_id",
    "identifications": "identification_id",
    "coupon-batches": "batch_id",
    "coupons": "coupon_id",
    "update-jobs": "job_id",
    "monitors": "monitor_id",
    "webhooks": "webhook_id",
    "frfs": "frf_id",
}
"""What a path calls the things of a collection."""


@dataclass
class Fuzzed:
    """What was sent, and what was wrong.

    Attributes:
        statuses: of the answers.
        answered: operations that a request has got through to, by a status of success.
        faults: of answers, each once, in words.
    """

    statuses: Counter[int] = field(default_factory=Counter)
    answered: Counter[str] = field(default_factory=Counter)
    faults: dict[str, str] = field(default_factory=dict)


class _Fuzzer:
    def __init__(self, service: LocalService, things: dict[str, str], key: str, start: int) -> None:
        self.found, self.choose = Fuzzed(), random.Random(start)
        self.things = defaultdict(list, {name: [value] for name, value in things.items()})
        self.headers = {"Authorization": f"Bearer {key}"}
        self.schema = schemathesis.openapi.from_url(f"{service.url}/openapi.json")
        self.operations = [made.ok() for made in self.schema.get_all_operations() if isinstance(made, Ok)]

    def round(self, examples: int, number: int) -> None:
        """Some requests of each operation."""
        for operation in self.choose.sample(self.operations, len(self.operations)):
            if operation.path.endswith("/events"):  # a stream has no end
                continue
            self._some(operation, examples, number)

    def _some(self, operation: Any, examples: int, number: int) -> None:
        @seed(number)
        @settings(
            max_examples=examples, deadline=None, database=None, phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )  # fmt: skip
        @given(case=operation.as_strategy())
        def one(case: Any) -> None:
            self._send(operation.label, case)

        one()

    def _send(self, label: str, case: Any) -> None:
        for name in case.path_parameters or {}:
            if self.things[name] and self.choose.random() < 0.8:
                case.path_parameters[name] = self.choose.choice(self.things[name][-NEWEST:])
        answer = case.call(headers=self.headers, timeout=60)
        self.found.statuses[answer.status_code] += 1
        if answer.status_code < 300:
            self.found.answered[label] += 1
            self._note(answer)
        try:
            case.validate_response(answer, checks=CHECKS)
        except FailureGroup as error:
            first = str(error).strip().split("\n")
            self.found.faults.setdefault(f"{label} {answer.status_code}", "\n".join(first[:40]))

    def _note(self, answer: Any) -> None:
        """What was made may be named by later paths."""
        place = (answer.headers.get("location") or [""])[0]
        steps = place.removeprefix(PREFIX).split("/")
        if place.startswith(PREFIX) and len(steps) == 2 and steps[0] in KINDS:
            self.things[KINDS[steps[0]]].append(steps[1])


def fuzz(service: LocalService, minutes: float = 0.0, examples: int = 3, start: int = SEED) -> Fuzzed:
    """Send requests until the time is over, at least one round.

    Args:
        service: that runs with settings such as `ASKED_FREELY`.
        minutes: time to send for.
        examples: requests of each operation in a round.
        start: seed of the first round.
    """
    engine = make_engine(service.settings.database_url or "", pool_size=1)
    key = service.new_key("fuzz")
    headers = {"Authorization": f"Bearer {key}"}
    with httpx.Client(base_url=f"{service.url}{PREFIX}", headers=headers, timeout=120, trust_env=False) as client:
        things = furnish(client, make_sessions(engine), "fuzz").ids
        spare = client.post("api-keys", json={"name": "spare"}).raise_for_status().json()["id"]
    engine.dispose()
    fuzzer = _Fuzzer(service, things | {"key_id": spare, "member": "fuzz"}, key, start)
    end = time.monotonic() + 60 * minutes
    number = start
    fuzzer.round(examples, number)
    while time.monotonic() < end:
        number += 1
        fuzzer.round(examples, number)
    return fuzzer.found


@contextmanager
def running() -> Iterator[LocalService]:
    """A service on a temporary database, whose jobs are run."""
    with tempfile.TemporaryDirectory(prefix="mb-", ignore_cleanup_errors=True) as folder:
        data = Path(folder)
        data.chmod(0o755)  # the server may run as a user of its own
        with LocalService(Settings(data=data, port=0, log_level="error", **ASKED_FREELY)) as service:
            yield service


def report(found: Fuzzed) -> Iterator[str]:
    """What came of it, in lines."""
    yield f"{found.statuses.total()} requests: " + ", ".join(f"{n} × {s}" for s, n in sorted(found.statuses.items()))
    yield f"{len(found.answered)} operations answered with success"
    yield f"{len(found.faults)} faults"
    for name, fault in found.faults.items():
        yield f"{name}: {fault}"


if __name__ == "__main__":
    with running() as service:
        result = fuzz(service, float(sys.argv[1]) if len(sys.argv) > 1 else MINUTES, examples=10)
    print("\n".join(report(result)))
    sys.exit(1 if result.faults else 0)
