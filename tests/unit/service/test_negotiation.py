"""Which format an answer has, by the parameter `format` and by Accept with its q values (RFC 9110, 12.5.1)."""

import pytest

from service.errors import Invalid, NotAcceptable
from service.web.negotiation import choose_format

KNOWN = {"json": "application/json", "csv": "text/csv", "npz": "application/x-npz"}


@pytest.mark.parametrize(
    ("wanted", "accept", "chosen"),
    [
        (None, None, "json"),
        (None, " ", "json"),
        ("npz", "text/csv", "npz"),
        (None, "*/*", "json"),
        (None, "text/*", "csv"),
        (None, "application/json;q=0.4, text/csv; q=0.5", "csv"),
        (None, "application/json; v=1; q=0.9, text/csv;q=0.8", "json"),
        (None, "*/*, application/json;q=0", "csv"),  # the most specific range counts
        (None, "text/csv;q=much, application/x-npz;q=0.1", "npz"),
        (None, "text/csv;q=7, application/json", "json"),
    ],
)
def test_the_format_that_the_client_likes_best(wanted: str | None, accept: str | None, chosen: str) -> None:
    assert choose_format(wanted, accept, KNOWN) == chosen


def test_what_cannot_be_had_is_refused() -> None:
    with pytest.raises(Invalid, match="expected one of json, csv, npz"):
        choose_format("xml", None, KNOWN)
    with pytest.raises(NotAcceptable, match="image/png"):
        choose_format(None, "image/png, text/csv;q=0", KNOWN)
