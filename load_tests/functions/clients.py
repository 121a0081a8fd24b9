"""Clients over HTTP that keep their connection: one after another, or several at a time, with raw `http.client`."""

from __future__ import annotations

import http.client
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from load_tests.functions.figures import Calls

__all__ = ["Endpoint", "call_in_parallel", "call_one_by_one"]

TIMEOUT_S = 30.0


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Where calls go, and which status is a good one."""

    port: int
    path: str
    headers: Mapping[str, str] = field(default_factory=dict)
    good: int = 200


def call_one_by_one(endpoint: Endpoint, count: int, *, body: bytes = b'{"n":1}') -> Calls:
    """Calls of one client; a connection that breaks is a failed call, and the next one opens another."""
    took, failed = [], 0
    connection = http.client.HTTPConnection("127.0.0.1", endpoint.port, timeout=TIMEOUT_S)
    headers = {"Content-Type": "application/json", **endpoint.headers}
    began = time.perf_counter()
    for _ in range(count):
        start = time.perf_counter()
        try:
            connection.request("POST", endpoint.path, body, headers)
            answer = connection.getresponse()
            answer.read()
            good = answer.status == endpoint.good
        except (OSError, http.client.HTTPException):
            connection.close()
            good = False
        if good:
            took.append((time.perf_counter() - start) * 1000)
        else:
            failed += 1
    total = time.perf_counter() - began
    connection.close()
    return Calls(tuple(took), failed, total)


def call_in_parallel(endpoint: Endpoint, clients: int, count: int) -> Calls:
    """The same by several clients at a time, `count` calls each."""
    found: list[Calls] = []
    threads = [threading.Thread(target=lambda: found.append(call_one_by_one(endpoint, count))) for _ in range(clients)]
    began = time.perf_counter()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    total = time.perf_counter() - began
    return Calls(tuple(took for calls in found for took in calls.took_ms), sum(calls.failed for calls in found), total)
