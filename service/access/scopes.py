"""What a key may be used for. A role says what its user may do in a project; a scope narrows that for one key."""

from __future__ import annotations

from typing import Any, Literal, get_args

from starlette.types import Scope as RequestScope

from service.access.tables import ApiKey
from service.errors import Forbidden

Scope = Literal["read", "write", "jobs", "admin"]
SCOPES: tuple[Scope, ...] = get_args(Scope)

_ADMIN = ("api-keys", "members", "webhooks", "purge")
_JOBS = ("update-jobs", "identifications", "runs", "cancel", "retry", "plans", "processings")


def scope_of(method: str, path: str) -> Scope:
    """The scope that a route needs, by its method and its path with the ids' names in braces."""
    steps = [step for step in path.split("/") if not step.startswith("{")]
    if "users" in steps:
        return "admin"
    if method in ("GET", "HEAD") or steps[-1] == "session":  # whoever may read may do so in a browser
        return "read"
    if any(step in _ADMIN for step in steps) or (method == "DELETE" and steps[-1] == "projects"):
        return "admin"
    return "jobs" if steps[-1] in _JOBS else "write"


def require_scope(key: ApiKey, request: RequestScope) -> None:
    """Refuse a request that the key is not for.

    Raises:
        Forbidden: it lacks the scope.
    """
    route: Any = request.get("route")
    wanted = scope_of(request["method"], route.path)
    if wanted not in key.scopes:
        raise Forbidden(f"this needs a key of the scope {wanted}; this one has {', '.join(key.scopes)}")
