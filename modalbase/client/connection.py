"""HTTP to the service: pages, uploads and downloads of any size, and problem documents as one
line.
"""

import os
import ssl
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Self
from urllib.parse import urlsplit

import httpx

from modalbase.client.endpoint import checked_key, checked_url
from modalbase.client.errors import ClientError, Exit

BLOCK_BYTES = 1 << 20
PAGE_ROWS = 1000
SECONDS = 120.0
HERE = ("127.0.0.1", "localhost", "::1")

Watch = Callable[[int, int | None], None]
"""Called with the bytes that have passed, and their total."""


def no_certificates() -> ssl.SSLContext:
    """What a client over plain HTTP trusts: nobody. Loading the authorities' certificates takes
    httpx 25 ms each time.
    """
    return ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)


class Connection:
    """A client of one service with one key; a context manager that closes its connections.

    Of all methods, `path` is one of the REST contract below `/api/v1/`, without a leading slash,
    and `params` are those of the query, of which those that are None are left out. They raise
    `ClientError` where the service does not answer, is not modalbase, or refuses; then with its
    message, each fault with its pointer.

        with Connection("http://127.0.0.1:8000", key) as service:
            for campaign in service.pages("campaigns"):
                print(campaign["name"],
                len(service.get(f"campaigns/{campaign['id']}/frfs")["items"]))
    """

    def __init__(self, url: str, key: str | None = None) -> None:
        """Prepare; nothing is sent before the first call.

        Args:
            url: of the service, such as `http://127.0.0.1:8000`.
            key: API key; by default that of MODALBASE_API_KEY. `find_endpoint` looks further.

        Raises:
            ClientError: there is no key, or the URL is none.
        """
        self.url = checked_url(url)
        key = checked_key(os.environ.get("MODALBASE_API_KEY", "") if key is None else key)
        here = urlsplit(url).hostname in HERE
        self._http = httpx.Client(
            headers={"Authorization": f"Bearer {key}"},
            timeout=SECONDS,
            trust_env=not here,  # a proxy must not come between us and our own machine
            verify=no_certificates() if here and urlsplit(url).scheme == "http" else True,
        )

    @classmethod
    def over(cls, http: httpx.Client) -> Self:
        """A connection by an httpx client with trust, key and base URL of its own; who made the
        client closes it.
        """
        connection = cls.__new__(cls)
        connection.url, connection._http = str(http.base_url).rstrip("/"), http
        return connection

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close its connections."""
        self._http.close()

    def request(self, method: str, path: str, **how: Any) -> httpx.Response:
        """The answer to a request that the service has accepted, with its headers; `how` is as
        httpx takes it.
        """
        try:
            answer = self._http.request(method, self._at(path), **how)
        except httpx.HTTPError as error:
            raise self._unreachable(error) from error
        self._check(answer)
        return answer

    def get(self, path: str, **params: Any) -> dict[str, Any]:
        """The JSON object at a path."""
        return self._json(self.request("GET", path, params=_given(params)))

    def post(
        self, path: str, body: Any, headers: dict[str, str] | None = None, **params: Any
    ) -> dict[str, Any]:
        """Send a JSON body, with headers such as `Idempotency-Key` beside the key; returns the JSON
        that answers it.
        """
        return self._json(
            self.request("POST", path, json=body, headers=headers, params=_given(params))
        )

    def call(
        self, method: str, path: str, *, params: Mapping[str, Any] | None = None, **how: Any
    ) -> Any:
        """Any call of the contract.

        Args:
            method: of HTTP.
            path: of the call.
            params: of the query.
            how: `json`, `content`, `headers`, `files`, `data` as httpx takes them.

        Returns:
            The JSON that answers it, the bytes of any other answer, None of an empty one.
        """
        answer = self.request(method, path, params=_given(dict(params or {})), **how)
        if not answer.content:
            return None
        kind = answer.headers.get("content-type", "")
        return self._json(answer) if "json" in kind.split(";")[0] else answer.content

    def lines(self, path: str, headers: dict[str, str] | None = None) -> Iterator[str]:
        """The lines of an answer as they come, such as those of a stream of events; its end is not
        known before.

        `headers`, such as `Last-Event-ID`, go beside the key.
        """
        try:
            with self._http.stream("GET", self._at(path), headers=headers) as answer:
                self._check(answer)
                yield from answer.iter_lines()
        except httpx.HTTPError as error:
            raise self._unreachable(error) from error

    def pages(self, path: str, most: int | None = None, **params: Any) -> Iterator[dict[str, Any]]:
        """The items of a list, at most so many, through all of its pages, which are fetched as they
        are needed.
        """
        cursor, left = None, most
        while left is None or left > 0:
            limit = PAGE_ROWS if left is None else min(PAGE_ROWS, left)
            page = self.get(path, cursor=cursor, limit=limit, **params)
            yield from page["items"]
            cursor = page["next_cursor"]
            left = None if left is None else left - len(page["items"])
            if cursor is None:
                return

    def upload(self, path: str, file: Path, watch: Watch, **params: Any) -> dict[str, Any]:
        """Send a file as raw body, block by block, so that it may be larger than the memory.

        Args:
            path: where to.
            file: what is sent.
            watch: called after each block.
            params: of the query.

        Returns:
            The JSON that answers it.
        """
        size = file.stat().st_size

        def blocks() -> Iterator[bytes]:
            sent = 0
            with file.open("rb") as stream:
                while block := stream.read(BLOCK_BYTES):
                    sent += len(block)
                    watch(sent, size)
                    yield block

        headers = {"Content-Type": "application/octet-stream", "Content-Length": str(size)}
        return self._json(
            self.request("POST", path, params=_given(params), content=blocks(), headers=headers)
        )

    def submit(
        self, path: str, file: Path, fields: dict[str, str], **params: Any
    ) -> dict[str, Any]:
        """Send a multipart form whose field `file` is a file, beside other fields; returns the JSON
        that answers it.
        """
        with file.open("rb") as stream:
            form = {"data": fields, "files": {"file": (file.name, stream)}}
            return self._json(self.request("POST", path, params=_given(params), **form))

    def download(self, path: str, target: Path | None, watch: Watch, **params: Any) -> int:
        """Write what is at a path to a file, or to standard output. The file is whole, or not
        there.

        Args:
            path: what is fetched.
            target: where to; None for standard output. A pipe or a device is written to and stays.
            watch: called after each block.
            params: of the query.

        Returns:
            The number of bytes.

        Raises:
            ClientError: as all methods, or the target cannot be written.
        """
        try:
            with self._http.stream("GET", self._at(path), params=_given(params)) as answer:
                self._check(answer)
                length = answer.headers.get("content-length")
                blocks = _watched(answer.iter_bytes(), watch, int(length) if length else None)
                return _write(blocks, target)
        except httpx.HTTPError as error:
            raise self._unreachable(error) from error

    def _at(self, path: str) -> str:
        return f"{self.url}/api/v1/{path}"

    def _check(self, answer: httpx.Response) -> None:
        if answer.is_success:
            return
        answer.read()
        try:
            problem = answer.json()
            faults = [f"{f['pointer'] or 'body'}: {f['detail']}" for f in problem.get("errors", [])]
            text = "; ".join(faults) or str(problem["detail"])
        except (ValueError, TypeError, KeyError, AttributeError):
            raise ClientError(
                f"{answer.url.host} answers {answer.status_code}, and not as modalbase does; is"
                f" {self.url} right?",
                Exit.UNREACHABLE,
                status=answer.status_code,
            ) from None
        code = Exit.UNREACHABLE if answer.status_code in (502, 503, 504) else Exit.REFUSED
        raise ClientError(
            f"{text} ({answer.status_code})", code, status=answer.status_code, problem=problem
        )

    def _json(self, answer: httpx.Response) -> dict[str, Any]:
        try:
            # each call of the contract answers by an object
            document: dict[str, Any] = answer.json()
        except ValueError:
            raise ClientError(
                f"{self.url} does not answer in JSON; is it modalbase's address?", Exit.UNREACHABLE
            ) from None
        return document

    def _unreachable(self, error: httpx.HTTPError) -> ClientError:
        reason = str(error) or type(error).__name__
        return ClientError(
            f"no answer from {self.url}: {reason}; is the service up (`modalbase up`), and is"
            " MODALBASE_URL or --url right?",
            Exit.UNREACHABLE,
        )


def _given(params: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in params.items() if value is not None}


def _watched(blocks: Iterator[bytes], watch: Watch, size: int | None) -> Iterator[bytes]:
    got = 0
    for block in blocks:
        got += len(block)
        watch(got, size)
        yield block


def _write(blocks: Iterator[bytes], target: Path | None) -> int:
    if target is None:
        size = sum(sys.stdout.buffer.write(block) for block in blocks)
        sys.stdout.buffer.flush()
        return size
    try:
        # /dev/null, a pipe: nothing to be put in their place
        if target.exists() and not target.is_file():
            with target.open("wb") as file:
                return sum(file.write(block) for block in blocks)
        return _write_whole(blocks, target)
    except OSError as error:
        raise ClientError(f"cannot write {target}: {error.strerror}", Exit.USAGE) from error


def _write_whole(blocks: Iterator[bytes], target: Path) -> int:
    part = target.with_name(target.name + ".part")
    try:
        with part.open("wb") as file:
            size = sum(file.write(block) for block in blocks)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)
    return size
