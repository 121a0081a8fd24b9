"""Sends REST requests over HTTP: two thin clients around the same decisions, one blocking and one asynchronous."""

from __future__ import annotations

import asyncio
import ssl
import threading
from random import Random  # noqa: TID251  (the type of an argument)
from typing import Any, TypeVar

import httpx

from metaros.client.access import Access
from metaros.client.requests import RestRequest, answer_of
from metaros.client.retries import Retries
from metaros.clock import system_rng
from metaros.errors import MetarosError, PeerError, RefusedError, TimeoutError_, UnavailableError

__all__ = ["AsyncHttp", "Http"]

T = TypeVar("T")
USER_AGENT = "metaros-client"


class _Sender:
    """What both have: how a request looks, what its answer means, and when it is sent again."""

    def __init__(self, access: Access, *, timeout_s: float, retries: Retries, rng: Random | None) -> None:
        self._access = access
        self._timeout_s = timeout_s
        self._retries = retries
        self._rng = rng or system_rng()

    def _options(self) -> dict[str, Any]:
        """Of httpx's clients; proxies and keys of the environment are not used."""
        context = self._access.tls_context()
        return {
            "base_url": self._access.url,
            "headers": {"user-agent": USER_AGENT, **self._access.headers},
            "timeout": self._timeout_s,
            "trust_env": False,
            "verify": context or ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT),  # of http: it need not read any roots
        }

    def _request(self, request: RestRequest[Any]) -> dict[str, Any]:
        return {
            "method": request.method,
            "url": request.path,
            "params": request.sent_query,
            "content": request.content,
            "headers": request.sent_headers,
            "timeout": request.timeout_s or self._timeout_s,
        }

    def _wait_s(self, attempt: int, error: MetarosError, request: RestRequest[Any]) -> float:
        """How long to wait before the next attempt; raises the error when there is none."""
        after_s = getattr(error, "after_s", None)
        wait_s = self._retries.wait_s(attempt, error, idempotent=request.idempotent, rng=self._rng, after_s=after_s)
        if wait_s is None:
            raise error
        return wait_s


class Http(_Sender):
    """Blocks; may be used from several threads."""

    def __init__(self, access: Access, *, timeout_s: float, retries: Retries, rng: Random | None = None) -> None:
        super().__init__(access, timeout_s=timeout_s, retries=retries, rng=rng)
        self._client = httpx.Client(**self._options())
        self._closed = threading.Event()

    def send(self, request: RestRequest[T]) -> T:
        """What the answer means.

        Raises:
            RefusedError: the gateway refuses; `reason` says why.
            UnavailableError, TimeoutError_: nobody answers, or not in time.
        """
        attempt = 1
        while True:
            try:
                return request.read(answer_of(self._once(request)))
            except (PeerError, UnavailableError) as error:
                self.pause(self._wait_s(attempt, error, request))
                attempt += 1

    def pause(self, wait_s: float) -> bool:
        """Wait, but not beyond `close`; whether it was closed."""
        return self._closed.wait(wait_s)

    def close(self) -> None:
        """End its connections."""
        self._closed.set()
        self._client.close()

    def _once(self, request: RestRequest[Any]) -> bytes:
        try:
            return response_body(self._client.request(**self._request(request)))
        except httpx.HTTPError as error:
            raise unavailable(self._access.url, error) from error


class AsyncHttp(_Sender):
    """Awaits; of one event loop."""

    def __init__(self, access: Access, *, timeout_s: float, retries: Retries, rng: Random | None = None) -> None:
        super().__init__(access, timeout_s=timeout_s, retries=retries, rng=rng)
        self._client = httpx.AsyncClient(**self._options())

    async def send(self, request: RestRequest[T]) -> T:
        """As `Http.send`."""
        attempt = 1
        while True:
            try:
                return request.read(answer_of(await self._once(request)))
            except (PeerError, UnavailableError) as error:
                await asyncio.sleep(self._wait_s(attempt, error, request))
                attempt += 1

    async def close(self) -> None:
        """End its connections."""
        await self._client.aclose()

    async def _once(self, request: RestRequest[Any]) -> bytes:
        try:
            return response_body(await self._client.request(**self._request(request)))
        except httpx.HTTPError as error:
            raise unavailable(self._access.url, error) from error


class RetryLaterError(RefusedError):
    """Refused for now (Retry-After); `after_s` is when to try again."""

    def __init__(self, message: str, *, status: int, reason: str, after_s: float) -> None:
        super().__init__(message, status=status, reason=reason)
        self.after_s = after_s


def response_body(answer: httpx.Response) -> bytes:
    """The body of a good answer; RefusedError for a problem."""
    if answer.status_code < 400:
        return answer.content
    try:
        document = answer.json()
        text, reason = str(document.get("detail") or document.get("title")), str(document.get("code", ""))
    except (ValueError, AttributeError):
        text, reason = f"the gateway answered {answer.status_code}", ""
    after = answer.headers.get("retry-after", "")
    if after.isdigit():
        raise RetryLaterError(text, status=answer.status_code, reason=reason, after_s=float(after))
    raise RefusedError(text, status=answer.status_code, reason=reason)


def unavailable(url: str, error: httpx.HTTPError) -> MetarosError:
    """Why there is no answer."""
    if isinstance(error, httpx.TimeoutException) and not isinstance(error, httpx.ConnectTimeout):
        return TimeoutError_(f"the gateway at {url} did not answer in time")
    return UnavailableError(f"no gateway answers at {url}: {error or type(error).__name__}")
