"""Requests to a server: credentials, repeats after failures, pages, files, and errors with every fault.

A request is repeated only where that is safe. Requests that create something carry an idempotency key, which makes them safe too.
"""

from __future__ import annotations

import errno
import ipaddress
import json
import os
import random
import ssl
import sys
import time
import urllib.parse
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import certifi
import httpx

from roost.api.events import Event, parse
from roost.errors import ApiError, Fault, RoostError

DEFAULT_URL = "http://127.0.0.1:7373"

Params = Mapping[str, "str | int | float | bool | None"]

# Answers after which the same request may succeed. A full disk (507) stays full for longer than anybody waits.
_TRANSIENT = frozenset({408, 425, 429, 500, 502, 503, 504})
# Answers before anything was done.
_REFUSED = frozenset({425, 429, 503})
# A first connection that fails is rather a wrong address than a short interruption.
_FIRST_PATIENCE_S = 2.0
# The server sends a comment every 15 s.
_QUIET_STREAM_S = 45.0
# A table of a large sweep is made before its first byte is sent.
_WHOLE_FILE_S = 600.0


class Unreachable(RoostError, ConnectionError):
    """The server does not answer."""


class _Pauses:
    """Growing pauses between repeats, up to a total time from the first failure on."""

    def __init__(self, patience_s: Callable[[], float]) -> None:
        self._patience_s = patience_s
        self._end: float | None = None
        self._next_s = 0.1

    def wait(self, retry_after_s: float | None = None) -> bool:
        """Pauses, unless the time is over. Returns whether to repeat."""
        pause = retry_after_s if retry_after_s is not None else self._next_s * random.uniform(0.5, 1.0)
        now = time.monotonic()
        if self._end is None:
            self._end = now + self._patience_s()
        if now + pause > self._end:
            return False
        time.sleep(pause)
        self._next_s = min(2 * self._next_s, 5.0)
        return True


class _Busy(Exception):
    """An answer after which the same request may succeed."""

    def __init__(self, answer: httpx.Response) -> None:
        self.answer = answer


def _authorities(ca: str | None) -> ssl.SSLContext:
    """The authorities of a file; without one those of the system, or of SSL_CERT_FILE and SSL_CERT_DIR."""
    places = ssl.get_default_verify_paths()
    # Python on macOS finds none before its certificates are installed. Windows has its own store.
    if ca is None and sys.platform != "win32" and not (places.cafile or places.capath):
        ca = certifi.where()
    return ssl.create_default_context(cafile=ca)


class Transport:
    """A connection to a server, for any number of threads."""

    def __init__(
        self,
        url: str | None = None,
        token: str | None = None,
        *,
        ca: str | os.PathLike[str] | None = None,
        patience_s: float = 30.0,
    ) -> None:
        self.url = (url or os.environ.get("ROOST_SERVER") or DEFAULT_URL).rstrip("/")
        self._patience_s = patience_s
        self._was_reached = False
        token = token if token is not None else os.environ.get("ROOST_TOKEN")
        headers = {"user-agent": "roost-python", "accept": "application/json"}
        if token and token.strip():
            headers["authorization"] = f"Bearer {token.strip()}"
        ca = ca or os.environ.get("ROOST_CA")
        try:
            address = httpx.URL(self.url)
        except httpx.InvalidURL as error:
            raise _no_address(self.url) from error
        if address.scheme not in ("http", "https") or not address.host:
            raise _no_address(self.url)
        self._http = httpx.Client(
            base_url=self.url,
            headers=headers,
            timeout=httpx.Timeout(60.0, connect=10.0),
            # The server closes idle connections after 10 s.
            limits=httpx.Limits(max_connections=16, keepalive_expiry=5.0),
            verify=_authorities(os.fspath(ca) if ca else None),
            # A proxy of the environment cannot reach this machine's own addresses.
            trust_env=not _is_loopback(address.host),
        )

    def close(self) -> None:
        """Closes all connections."""
        self._http.close()

    def get(self, path: str, params: Params | None = None, *, timeout_s: float = 60.0) -> Any:
        """The JSON answer of a GET."""
        return self._json(self.send("GET", path, params=params, timeout_s=timeout_s))

    def post(
        self,
        path: str,
        document: Any = None,
        *,
        params: Params | None = None,
        key: str | None = None,
        is_repeatable: bool = True,
        timeout_s: float = 60.0,
    ) -> Any:
        """The JSON answer of a POST. Set `is_repeatable` to false where a repeat would change more, and no `key` prevents it."""
        headers = {"idempotency-key": key} if key else {}
        content = None
        if document is not None:
            headers["content-type"] = "application/json"
            content = json.dumps(document, allow_nan=False).encode()
        answer = self.send(
            "POST", path, params=params, content=content, headers=headers, is_repeatable=is_repeatable, timeout_s=timeout_s
        )
        return self._json(answer)

    def poll(self, path: str, etag: str | None) -> tuple[Any, str | None]:
        """The JSON answer of a GET and its etag. The answer is `None` if nothing has changed since `etag`."""
        answer = self.send("GET", path, headers={"if-none-match": etag} if etag else {})
        return (None, etag) if answer.status_code == 304 else (self._json(answer), answer.headers.get("etag"))

    def pages(self, path: str, params: Params | None = None, *, items: str = "items") -> Iterator[dict[str, Any]]:
        """The pages of a listing, which end with one without `next_cursor`."""
        query = dict(params or {})
        while True:
            page: dict[str, Any] = self.get(path, query, timeout_s=300.0)
            yield page
            if not page.get("next_cursor"):
                return
            query["cursor"] = page["next_cursor"]

    def items(self, path: str, params: Params | None = None, *, limit: int | None = None) -> Iterator[Any]:
        """The rows of a listing, newest first, at most `limit` of them."""
        count = 0
        for page in self.pages(path, {"limit": min(limit or 500, 500), **(params or {})}):
            for item in page["items"]:
                if limit is not None and count >= limit:
                    return
                count += 1
                yield item
            if limit is not None and count >= limit:
                return

    def send(
        self,
        method: str,
        path: str,
        *,
        params: Params | None = None,
        content: bytes | None = None,
        headers: Mapping[str, str] | None = None,
        is_repeatable: bool = True,
        timeout_s: float = 60.0,
    ) -> httpx.Response:
        """The answer to a request, after repeats.

        Raises `ApiError` when the server refuses it, and `Unreachable` without an answer.
        """
        request = self._http.build_request(
            method, path, params=_given(params), content=content, headers=dict(headers or {}),
            timeout=httpx.Timeout(timeout_s, connect=10.0),
        )  # fmt: skip
        pauses = self._pauses()
        while True:
            try:
                answer = self._http.send(request)
            except httpx.TransportError as error:
                is_sent = not isinstance(error, (httpx.ConnectError, httpx.ConnectTimeout, httpx.PoolTimeout))
                if (is_sent and not is_repeatable) or not pauses.wait():
                    raise self._unreachable(error) from error
                continue
            self._was_reached = True
            again = _TRANSIENT if is_repeatable else _REFUSED
            if answer.status_code in again and pauses.wait(_retry_after(answer)):
                continue
            return _accepted(answer, self.url)

    def download(self, path: str, target: Path, params: Params | None = None) -> Path:
        """Writes an answer to a file, which appears once it is complete."""
        if not target.parent.is_dir():
            raise FileNotFoundError(errno.ENOENT, "the folder of the file does not exist", str(target.parent))
        pauses = self._pauses()
        part = target.with_name(f"{target.name}.part")
        while True:
            try:
                with self._stream(path, params=params, quiet_s=_WHOLE_FILE_S) as answer, part.open("wb") as file:
                    for chunk in answer.iter_bytes():
                        file.write(chunk)
                return part.replace(target)
            except (httpx.TransportError, _Busy) as error:
                self._pause_or_raise(pauses, error)
            finally:
                part.unlink(missing_ok=True)

    def events(self, path: str) -> Iterator[Event]:
        """The events of a stream.

        After an interruption it continues behind the last event, and begins with one of the kind `resumed`.
        """
        last: str | None = None
        pauses = self._pauses()
        is_first = True
        while True:
            opened: float | None = None
            headers = {"accept": "text/event-stream", **({"last-event-id": last} if last else {})}
            try:
                with self._stream(path, headers=headers, quiet_s=_QUIET_STREAM_S) as answer:
                    if not is_first:
                        yield Event("resumed", {}, None)
                    is_first = False
                    opened = time.monotonic()
                    for event in parse(answer.iter_lines()):
                        last = event.id or last
                        yield event
                # The server stops: its successor continues the stream.
                raise httpx.RemoteProtocolError("the event stream has ended")
            except (httpx.TransportError, _Busy) as error:
                # A stream that worked for a while is no failure of the repeats before it.
                if opened is not None and time.monotonic() - opened > 1.0:
                    pauses = self._pauses()
                self._pause_or_raise(pauses, error)

    @contextmanager
    def _stream(
        self, path: str, *, params: Params | None = None, headers: Mapping[str, str] | None = None, quiet_s: float
    ) -> Generator[httpx.Response]:
        """The answer to a GET whose body is still to be read."""
        timeout = httpx.Timeout(quiet_s, connect=10.0)
        with self._http.stream("GET", path, params=_given(params), headers=dict(headers or {}), timeout=timeout) as answer:
            self._was_reached = True
            if not answer.is_success:
                answer.read()
            if answer.status_code in _TRANSIENT:
                raise _Busy(answer)
            yield _accepted(answer, self.url)

    def _pause_or_raise(self, pauses: _Pauses, error: httpx.TransportError | _Busy) -> None:
        """Pauses before a repeat, or raises the error if the time for repeats is over."""
        if isinstance(error, _Busy):
            if not pauses.wait(_retry_after(error.answer)):
                _accepted(error.answer, self.url)
        elif not pauses.wait():
            raise self._unreachable(error) from error

    def _pauses(self) -> _Pauses:
        return _Pauses(lambda: self._patience_s if self._was_reached else min(self._patience_s, _FIRST_PATIENCE_S))

    def _json(self, answer: httpx.Response) -> Any:
        try:
            return answer.json() if answer.content else None
        except ValueError as error:
            raise RoostError(f"{self.url} sent an answer that is no JSON: is this a Roost server?") from error

    def _unreachable(self, error: httpx.TransportError) -> Unreachable:
        start = "Start one with `roost up --data data --backend cpu`, or give the address as Client(url) or in ROOST_SERVER"
        advice = "" if self._was_reached else f". {start}"
        return Unreachable(f"cannot reach {self.url}: {error or type(error).__name__}{advice}")


def quoted(part: object) -> str:
    """A part of a path, such as an id or a name, without characters that mean something in an address."""
    return urllib.parse.quote(str(part), safe="")


def _accepted(answer: httpx.Response, url: str) -> httpx.Response:
    """The answer, unless it is an error."""
    if answer.is_success or answer.status_code == 304:
        return answer
    if answer.is_redirect:
        place = answer.headers.get("location", "another address")
        raise ApiError(
            answer.status_code, "Redirected", f"{url} redirects to {place}: give the address that serves Roost itself", [], None
        )
    try:
        problem = answer.json()
        title = str(problem["title"])
    except (ValueError, KeyError, TypeError):
        raise ApiError(answer.status_code, answer.reason_phrase or "Error", answer.text[:300].strip(), [], None) from None
    faults = [
        Fault(row.get("pointer", ""), row.get("value"), row.get("detail", ""), row.get("allowed"))
        for row in problem.get("errors", [])
    ]
    raise ApiError(answer.status_code, title, problem.get("detail", ""), faults, answer.headers.get("x-request-id"))


def _retry_after(answer: httpx.Response) -> float | None:
    try:
        return max(0.0, float(answer.headers["retry-after"]))
    except (KeyError, ValueError):
        return None


def _given(params: Params | None) -> dict[str, str | int | float]:
    """The parameters that have a value; truth values as the server spells them."""
    given = {name: value for name, value in (params or {}).items() if value is not None}
    return {name: str(value).lower() if isinstance(value, bool) else value for name, value in given.items()}


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def _no_address(url: str) -> RoostError:
    return RoostError(f"`{url}` is not the address of a server: write it like {DEFAULT_URL}")
