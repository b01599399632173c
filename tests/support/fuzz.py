"""Requests that Schemathesis draws from the OpenAPI document, right and wrong ones."""

import random
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import Any

from service.app.supervisor import LocalService
from service.platform.db.engine import make_engine, make_sessions
from tests.support.furnished import furnish
from tests.support.rest import client_of

PREFIX, NEWEST = "/api/v1/", 20  # things of a kind that paths name
KINDS = {"coupon-batches": "batch_id", "update-jobs": "job_id"}
"""What a path calls the things of a collection, where it is not the singular."""


@dataclass
class Fuzzed:
    """Statuses of the answers; operations that a request has got through to; faults of answers,
    each once, in words.
    """

    statuses: Counter[int] = field(default_factory=Counter)
    answered: Counter[str] = field(default_factory=Counter)
    faults: dict[str, str] = field(default_factory=dict)


def fuzz(
    service: LocalService, rounds: int = 1, examples: int = 3, start: int = 14, among: int = 1
) -> Fuzzed:
    """Send rounds of requests.

    What a path names is taken from what exists: at first one thing of each kind, then also what the
    requests themselves have made, so that they meet things in every state. No answer may be an
    error of the service, or one that the document does not know: status, content type, headers and
    body are held against it.

    Args:
        service: that runs with settings such as `ASKED_FREELY`.
        rounds: how many.
        examples: requests of each operation in a round.
        start: seed of the first round.
        among: one operation in so many is asked in a round.
    """
    engine = make_engine(service.settings.database_url, pool_size=1)
    with client_of(service, "fuzz") as client:
        things = furnish(client, make_sessions(engine), "fuzz")
        things |= {
            "key_id": client.post("api-keys", json={"name": "spare"}).json()["id"],
            "member": "fuzz",
        }
        key = client.headers["Authorization"]
    engine.dispose()
    fuzzer = _Fuzzer(service, things, key, start, among)
    for number in range(start, start + rounds):
        fuzzer.round(examples, number)
    return fuzzer.found


def _removes(operation: Any) -> bool:
    return bool(operation.method == "delete" or operation.path.endswith("/purge"))


class _Fuzzer:
    def __init__(
        self, service: LocalService, things: dict[str, str], key: str, start: int, among: int
    ) -> None:
        import schemathesis
        from schemathesis import checks
        from schemathesis.core.result import Ok
        from schemathesis.specs.openapi import checks as documented

        self.found, self.choose, self.among = Fuzzed(), random.Random(start), among
        self.things = defaultdict(list, {name: [value] for name, value in things.items()})
        self.headers = {"Authorization": key}
        schema = schemathesis.openapi.from_url(f"{service.url}/openapi.json")
        self.operations = [
            made.ok() for made in schema.get_all_operations() if isinstance(made, Ok)
        ]
        names = ("content_type", "response_headers", "response_schema", "status_code")
        self.checks = [
            checks.not_a_server_error,
            *(getattr(documented, f"{name}_conformance") for name in names),
        ]

    def round(self, examples: int, number: int) -> None:
        """Some requests of each operation; what removes things comes last, or the others would find
        nothing.
        """
        mixed = self.choose.sample(self.operations, len(self.operations) // self.among)
        for operation in sorted(mixed, key=_removes):
            if not operation.path.endswith("/events"):  # a stream has no end
                self._some(operation, examples, number)

    def _some(self, operation: Any, examples: int, number: int) -> None:
        from hypothesis import HealthCheck, Phase, given, seed, settings

        unhindered = {
            "deadline": None,
            "database": None,
            "suppress_health_check": list(HealthCheck),
        }

        @seed(number)
        @settings(max_examples=examples, phases=[Phase.generate], **unhindered)
        @given(case=operation.as_strategy())
        def one(case: Any) -> None:
            self._send(operation.label, case)

        one()

    def _send(self, label: str, case: Any) -> None:
        from schemathesis.core.failures import FailureGroup

        for name in case.path_parameters or {}:
            if self.things[name] and self.choose.random() < 0.8:
                case.path_parameters[name] = self.choose.choice(self.things[name][-NEWEST:])
        answer = case.call(headers=self.headers, timeout=60)
        self.found.statuses[answer.status_code] += 1
        if answer.status_code < 300:
            self.found.answered[label] += 1
            steps = (answer.headers.get("location") or [""])[0].removeprefix(PREFIX).split("/")
            if len(steps) == 2:  # what was made may be named by later paths
                self.things[
                    KINDS.get(steps[0], steps[0].removesuffix("s").replace("-", "_") + "_id")
                ].append(steps[1])
        try:
            case.validate_response(answer, checks=self.checks)
        except FailureGroup as error:
            first = str(error).strip().split("\n")
            self.found.faults.setdefault(f"{label} {answer.status_code}", "\n".join(first[:40]))
