"""What may be asked of the supervisor over its control socket: one function a verb, in one table."""

from __future__ import annotations

import asyncio
import contextlib
import math
import signal
from collections.abc import Awaitable, Callable
from typing import Any, Final

from metaros.errors import ConfigError
from metaros.supervise.control import Request
from metaros.supervise.logs.reader import read_page
from metaros.supervise.node_table_file import MAX_ROWS, read_rows
from metaros.supervise.service import NodeService

__all__ = ["Verbs"]

WAIT_S: Final = 30.0  # the longest that `list` and `tail` wait for something new
TAIL_STEP_S: Final = 0.2
MOST_S: Final = 1e10
READING: Final = 2  # logs are looked through at a time: whoever searches does not keep leases from their end
Answer = dict[str, Any]


class Verbs:
    """Answers requests by a service; `end` is called by `shutdown`."""

    def __init__(self, service: NodeService, end: Callable[[], None]) -> None:
        self._service = service
        self._end = end
        self._reading = asyncio.Semaphore(READING)
        self._table: dict[str, Callable[[Request], Awaitable[Answer]]] = {
            "list": self._list,
            "set_table": self._set_table,
            "start": self._start,
            "stop": self._stop,
            "restart": self._restart,
            "retry": self._retry,
            "signal": self._signal,
            "log": self._log,
            "tail": self._tail,
            "crashes": self._crashes,
            "leases": self._leases,
            "shutdown": self._shutdown,
        }

    async def handle(self, verb: str, request: Request) -> Answer:
        """One request. Raises ConfigError, UnavailableError, OSError."""
        known = self._table.get(verb)
        if known is None:
            raise ConfigError(f"no verb {verb[:40]!r}; there are: {', '.join(self._table)}")
        return await known(request)

    async def _list(self, request: Request) -> Answer:
        """The nodes; with `since` and `life` of an earlier answer it waits until there is something new."""
        service, wait_s = self._service, _seconds(request, "wait_s", WAIT_S)
        if request.get("life") == service.life and request.get("since") == service.revision and wait_s:
            changed = service.changed
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(wait_s):
                    await changed.wait()
        return service.list_()

    async def _set_table(self, request: Request) -> Answer:
        rows, tag = read_rows(request.get("rows")), request.get("tag", "")
        if not isinstance(tag, str) or len(tag) > 256:
            raise ConfigError("tag: expected a text of at most 256 characters")
        await self._service.do(self._service.set_table(rows, tag=tag))
        return self._service.list_()

    async def _start(self, request: Request) -> Answer:
        await self._service.do(self._service.start_node(_node(request)))
        return {}

    async def _stop(self, request: Request) -> Answer:
        await self._service.do(self._service.stop_node(_node(request)))
        return {}

    async def _restart(self, request: Request) -> Answer:
        await self._service.do(self._service.restart_node(_node(request)))
        return {}

    async def _retry(self, request: Request) -> Answer:
        await self._service.do(self._service.retry_node(_node(request)))
        return {}

    async def _signal(self, request: Request) -> Answer:
        number = request.get("signal")
        if type(number) is not int or number not in {item.value for item in signal.Signals}:
            raise ConfigError("signal: expected the number of a signal that this system has")
        self._service.signal_node(_node(request), number)
        return {}

    async def _log(self, request: Request) -> Answer:
        """A page of a node's log."""
        path = self._service.log_path(_node(request))
        cursor, query, backwards = _text(request, "cursor"), _text(request, "query"), request.get("backwards", False)
        size = request.get("max_bytes", 0)
        if type(size) is not int or size < 0 or not isinstance(backwards, bool):
            raise ConfigError("max_bytes: a whole number from 0; backwards: true or false")
        async with self._reading:
            page = await asyncio.to_thread(
                read_page, path, cursor=cursor, max_bytes=size, query=query, backwards=backwards
            )
        return page.as_json()

    async def _tail(self, request: Request) -> Answer:
        """The page after a cursor, as soon as there is one; an empty one after `wait_s`."""
        left_s = _seconds(request, "wait_s", WAIT_S)
        while True:
            answer = await self._log({**request, "backwards": False})
            if answer["lines"] or left_s <= 0:
                return answer
            await asyncio.sleep(min(TAIL_STEP_S, left_s))
            left_s -= TAIL_STEP_S
            request = {**request, "cursor": answer["cursor"]}

    async def _crashes(self, request: Request) -> Answer:
        return {"crashes": self._service.crashes(_node(request))}

    async def _leases(self, request: Request) -> Answer:
        """All leases that are held. They count from `at_s`, a reading of `metaros.clock.boot_s` by the agent: however
        long the words were on their way from there to here.
        """
        given = request.get("leases")
        if not isinstance(given, list) or len(given) > MAX_ROWS:
            raise ConfigError(f"leases: expected a list of at most {MAX_ROWS}")
        leases, epochs = [], {}
        for item in given:
            if not isinstance(item, dict):
                raise ConfigError("leases: expected objects")
            lease_id = item.get("lease_id")
            if not isinstance(lease_id, str) or len(lease_id) > 128:
                raise ConfigError("lease_id: expected a text of at most 128 characters")
            leases.append((_node(item), lease_id, _seconds(item, "valid_s", math.inf)))
            epochs[_node(item)] = _epoch(item)
        at_s, now_s = _seconds(request, "at_s", math.inf), self._service.lease_s()
        if not at_s or at_s > now_s + 0.001:
            raise ConfigError("at_s: when the leases were given, by the clock of leases of this machine")
        self._service.set_leases(leases, age_s=now_s - at_s, epochs=epochs)
        return {}

    async def _shutdown(self, request: Request) -> Answer:
        self._end()
        return {}


def _node(request: Request) -> str:
    name = request.get("node")
    if not isinstance(name, str):
        raise ConfigError("node: expected a name")
    return name


def _epoch(request: Request) -> int:
    epoch = request.get("epoch", 0)
    if isinstance(epoch, bool) or not isinstance(epoch, int) or not 0 <= epoch < 1 << 63:
        raise ConfigError("epoch: expected a number from 0")
    return epoch


def _text(request: Request, key: str) -> str:
    text = request.get(key, "")
    if not isinstance(text, str):
        raise ConfigError(f"{key}: expected a text")
    return text


def _seconds(request: Request, key: str, most: float) -> float:
    found = request.get(key, 0.0)
    if isinstance(found, bool) or not isinstance(found, int | float) or not 0 <= found <= MOST_S:
        raise ConfigError(f"{key}: expected seconds from 0")
    return min(float(found), most)
