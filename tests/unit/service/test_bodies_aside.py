"""Files and forms as the service reads them, in the process itself: what comes out, and what is said where nothing does."""

import asyncio
import json
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.requests import Request

from fecore.errors import InputError
from modalbase.formats.uff import DatasetReport, Function, GridPoint
from service.compute import reading
from service.errors import PayloadTooLarge
from service.jobs import aside, process
from service.jobs.child import Failure, Item
from service.jobs.process import LOST, ChildEnded
from service.store.coupons import routes as bodies
from tests.support.uff import axis, dataset, set_58


def rows(values: np.ndarray) -> list[str]:
    """Lines of 4E20.12."""
    flat = np.ravel(np.column_stack((values.real, values.imag)) if np.iscomplexobj(values) else values)
    return ["".join(f"{v:20.12e}" for v in flat[i : i + 4]) for i in range(0, flat.size, 4)]


def spectrum(function: int, values: np.ndarray, response: int, reference: int, ordinate: bytes) -> bytes:
    kind = 6 if np.iscomplexobj(values) else 4
    ends = {"response": (response, 3), "reference": (reference, 3)}
    return set_58(*rows(values), kind=kind, points=values.size, function=function, ordinate=ordinate, **ends)


def test_spectra_of_a_file_become_an_frf_and_points_come_in_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hz = np.arange(256.0)
    exact = 1 / ((300.0 / 6) ** 2 - hz**2 + 2j * hz)
    points = dataset("15", *(f"{n:10d}{0:10d}{0:10d}{0:10d}{n:13.5e}{0:13.5e}{0:13.5e}" for n in (1, 2, 3)))
    parts = (
        points,
        spectrum(2, np.full(256, 2.0), 1, 1, axis(13, "NONE")),
        spectrum(2, 16 * np.abs(exact) ** 2, 7, 7, axis(8, "NONE")),
        spectrum(3, 2 * exact, 7, 1, axis(8, "NONE")),
    )
    path = tmp_path / "file.uff"
    path.write_bytes(b"".join(parts))
    monkeypatch.setattr(reading, "POINTS_AT_ONCE", 2)
    found = list(reading.read_upload(reading.ReadingInputs(path, None), lambda *_: None))
    blocks = [item for item in found if isinstance(item, list)]
    assert [[point.number for point in block] for block in blocks] == [[1, 2], [3]]
    assert all(isinstance(point, GridPoint) for block in blocks for point in block)
    (frf,) = [item for item in found if isinstance(item, reading.EncodedFrf)]
    assert (frf.response_point, frf.reference_point, frf.axis.count) == (7, 1, 256)
    (coherence,) = [item for item in found if isinstance(item, Function)]
    np.testing.assert_allclose(coherence.values, 4 / 32, rtol=1e-9)  # |2 H|² over 2 and 16 |H|²
    assert [item.number for item in found if isinstance(item, DatasetReport)] == [1, 2, 3, 4]
    path.write_bytes(parts[0][:-20])
    with pytest.raises(InputError, match=r"\(byte "):
        list(reading.read_upload(reading.ReadingInputs(path, None), lambda *_: None))


class Dead:
    """A child in whose place an error comes."""

    def __init__(self, order: aside.Order) -> None:
        self.order = order

    def messages(self) -> Iterator[Item]:
        """What the function makes, as if it had come through a channel."""
        try:
            yield from map(Item, self.order.compute(self.order.inputs, None))
        except ZeroDivisionError:
            raise ChildEnded(Failure("internal", "ZeroDivisionError", "internal error", trace="the trace")) from None
        except MemoryError:
            raise ChildEnded(Failure("memory", "MemoryError", "the job needs more memory")) from None

    def kill(self, why: Failure) -> None:
        """Nothing runs."""

    def close(self) -> None:
        """Nothing is open."""


def raises(error: Exception) -> None:
    raise error


def test_a_body_is_read_although_the_fork_server_died_and_what_it_meets_is_told_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    died, prepared = [LOST], []

    def begun(order: aside.Order) -> Dead:
        if died:
            raise ChildEnded(died.pop())
        return Dead(order)

    monkeypatch.setattr(aside, "Child", begun)
    monkeypatch.setattr(aside, "preload", lambda modules, threads: prepared.append((modules, threads)))
    assert aside._read(len, ("abc",)) == 3
    assert prepared == [(["builtins"], 1)] * 2
    with pytest.raises(InputError, match="is empty"):
        aside._read(raises, (InputError("file", "is empty"),))
    with pytest.raises(RuntimeError, match="the trace"):
        aside._read(raises, (ZeroDivisionError(),))
    with pytest.raises(PayloadTooLarge, match="cannot be read here: the job needs more memory"):
        aside._read(raises, (MemoryError(),))


def test_sockets_of_the_fork_server_fit_under_a_long_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    for usual, within in (("/x" * 60, "/tmp"), ("/short", "/short")):
        monkeypatch.setattr(tempfile, "tempdir", usual)
        with process._short_folder():
            assert tempfile.gettempdir() == within
        assert tempfile.gettempdir() == usual


def multipart_request(**fields: str) -> Request:
    """A request with a file of 40 bytes and text fields."""
    text = "".join(f'--x\r\nContent-Disposition: form-data; name="{k}"\r\n\r\n{v}\r\n' for k, v in fields.items())
    file = 'Content-Disposition: form-data; name="file"; filename="a.csv"\r\nContent-Type: text/csv\r\n\r\n'
    body = f"{text}--x\r\n{file}{40 * '1'}\r\n--x--\r\n".encode()

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": body, "more_body": False}

    headers = [(b"content-type", b"multipart/form-data; boundary=x")]
    return Request({"type": "http", "method": "POST", "path": "/", "headers": headers}, receive)


def test_a_curve_has_no_more_bytes_than_a_json_body() -> None:
    request: Callable[[], Request] = lambda: multipart_request(coupon=json.dumps({}))  # noqa: E731
    with pytest.raises(PayloadTooLarge, match="the file has 40 bytes, the operator allows 30"):
        asyncio.run(bodies._curve(request(), 30))
