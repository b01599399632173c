"""Names in a query that a route does not know: a mistyped filter would answer with more than was asked for."""

from __future__ import annotations

from collections.abc import Iterable, Set

from fastapi.dependencies.models import Dependant

from service.errors import Fault, Invalid

_PAGING = {"cursor", "limit"}
"""Allowed everywhere: a script that pages through all lists alike meets some that come whole."""


def query_names(dependant: Dependant) -> frozenset[str]:
    """Names of the query's parameters that a route and all that it depends on declare."""
    own = {field.alias for field in dependant.query_params}
    return frozenset(own.union(*(query_names(one) for one in dependant.dependencies)))


def require_known(sent: Iterable[str], known: Set[str]) -> None:
    """Refuse names of query parameters that are not among the known ones.

    Raises:
        Invalid: each unknown name, with those that there are.
    """
    unknown = sorted(set(sent) - known - _PAGING)
    if unknown:
        there_are = f"expected one of {', '.join(sorted(known))}" if known else "this address takes none"
        raise Invalid([Fault(name, f"is no parameter of this query; {there_are}") for name in unknown])
