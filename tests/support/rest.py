"""REST as the tests use it: a client with a key of its own, answers that must be good, jobs that
must end.
"""

from typing import Any

import httpx

from fecore.modes import MeasuredModes
from modalbase.client.connection import no_certificates
from service.app.supervisor import LocalService
from service.pages.example import paper
from tests.support.waiting import PATIENCE, until

ONCE = httpx.Limits(max_connections=None, max_keepalive_connections=0)
RAW = {"Content-Type": "application/octet-stream"}
ASKED_FREELY: dict[str, Any] = {
    "webhook_networks": "198.51.100.0/24",  # so the service must be allowed to send there
    "key_requests_a_second": 10**6,
    "key_failures_a_minute": 10**6,
}
"""Settings of a service that is asked as much as can be."""


def client_at(url: str, key: str, limits: httpx.Limits = ONCE) -> httpx.Client:
    """A client of an API at an address, with a key.

    It uses no connection twice: an idle one may be closed by the service at the very moment of its
    next use.
    """
    return plain_client(f"{url}/api/v1/", {"Authorization": f"Bearer {key}"}, limits)


def plain_client(
    base_url: httpx.URL | str, headers: dict[str, str] | None = None, limits: httpx.Limits = ONCE
) -> httpx.Client:
    """A client over HTTP without TLS."""
    return httpx.Client(
        base_url=base_url,
        headers=headers,
        timeout=PATIENCE,
        trust_env=False,
        limits=limits,
        verify=no_certificates(),
    )


def client_of(service: LocalService, name: str) -> httpx.Client:
    """A client of a running service, with a new key for a user of that name."""
    return client_at(service.url, service.new_key(name))


def session_client(
    api: httpx.Client, headers: dict[str, str] | None = None, base: httpx.URL | str | None = None
) -> httpx.Client:
    """A client with the cookie and the request token of a new session, and no key.

    Args:
        api: whose key begins the session.
        headers: such as another key.
        base: of its addresses; default: the API's.
    """
    answer = api.post("session", headers=headers)
    token = ok(answer, 201)["csrf_token"]
    own = {"Cookie": answer.headers["set-cookie"].split(";")[0], "X-CSRF-Token": token}
    return plain_client(base or api.base_url, own)


def ok(answer: httpx.Response, status: int | None = None) -> Any:
    """The body of an answer that must have this status, or be any success."""
    good = answer.is_success if status is None else answer.status_code == status
    assert good, f"{answer.status_code}: {answer.text}"
    return answer.json() if answer.content else None


def every_page(api: httpx.Client, path: str, params: dict[str, Any]) -> list[Any]:
    """The items of a list, page by page to its end."""
    page = ok(api.get(path, params=params), 200)
    cursor = page["next_cursor"]
    return page["items"] + (every_page(api, path, params | {"cursor": cursor}) if cursor else [])


def finished(api: httpx.Client, location: str) -> dict[str, Any]:
    """The last state of a job or an import at an address, once it has ended."""
    address = api.base_url.join(location)
    state: dict[str, Any] = {}

    def ended() -> bool:
        state.update(ok(api.get(address), 200))
        return state["status"] in ("succeeded", "failed", "cancelled")

    until(ended, f"the end of {location}", lambda: state)
    return state


def result_of(api: httpx.Client, location: str) -> dict[str, Any]:
    """The result document of an update job at an address."""
    return ok(api.get(api.base_url.join(f"{location}/result")), 200)


def mode_rows(modes: MeasuredModes, relative_sd: float) -> list[dict[str, Any]]:
    """Measured modes with shapes as a mode set's body has them, each frequency with this share of
    it as its sd.
    """
    assert modes.shapes is not None
    return [
        {
            "frequency_hz": float(hz),
            "frequency_sd_hz": relative_sd * float(hz),
            "damping_ratio": 0.01,
            "damping_sd": 1e-4,
            "shape": [
                {
                    "point": dof.point,
                    "direction": dof.direction,
                    "real": float(value.real),
                    "imag": 0.0,
                }
                for dof, value in zip(modes.dofs, shape, strict=True)
            ],
        }
        for hz, shape in zip(modes.frequency_hz, modes.shapes, strict=True)
    ]


def posted(api: httpx.Client, path: str, body: Any = None, **more: Any) -> Any:
    """What a POST, of JSON by default, answers with success."""
    return ok(api.post(path, **({"json": body} if body is not None else {}), **more))


def campaigns_of(api: httpx.Client, name: str, count: int = 1) -> list[str]:
    """Ids of new campaigns of the paper's beam, without FRFs, in a project of their own."""
    project = posted(api, "projects", {"name": name})["id"]
    structure = posted(api, f"projects/{project}/structures", paper.STRUCTURE)["id"]
    path = f"structures/{structure}/campaigns"
    return [
        str(posted(api, path, {**paper.CAMPAIGN, "name": f"{name} {n}"})["id"])
        for n in range(count)
    ]


def pointers(problem: dict[str, Any]) -> set[str]:
    """The places of all faults of a problem document."""
    return {fault["pointer"] for fault in problem["errors"]}
