"""Zenoh's threads keep their Python thread state once they have brought a liveliness token."""

from __future__ import annotations

import sys
import threading
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh

from metaros.wire import Graph, WireSession
from metaros.wire.thread_state import pin_thread_state
from tests.support.nodes.raw_peer import open_session
from tests.support.waiting import wait_until


def test_what_is_put_arrives() -> None:
    queue: SimpleQueue[Any] = SimpleQueue()
    pin_thread_state(queue.put)("token")
    assert queue.get() == "token"


@pytest.mark.skipif(sys.implementation.name != "cpython", reason="only CPython's states are pinned")
def test_a_state_outlives_the_call_of_a_sample(zenoh_router: str) -> None:
    session, peer = WireSession(domain_id=0, connect=zenoh_router, environ={}), open_session(zenoh_router)
    graph, own, calls = Graph(session), threading.local(), list[int]()

    def on_sample(_: Any) -> None:  # what is the thread's own in Python goes with its state
        own.calls = getattr(own, "calls", 0) + 1
        calls.append(own.calls)

    try:
        sink = zenoh.handlers.Callback(on_sample, indirect=False)
        subscriber = session.check_open().declare_subscriber("pinned", sink)
        tokens = []

        def remembered() -> bool:
            """Tokens and samples on and on: whichever of Zenoh's threads brings them."""
            number = len(tokens)
            tokens.append(peer.liveliness().declare_token(f"@ros2_lv/0/abc/{number}/{number}/NN/%/%/n{number}"))
            peer.put("pinned", b"")
            return max(calls, default=0) >= 10

        wait_until(remembered, timeout_s=60)
        subscriber.undeclare()  # type: ignore[no-untyped-call]
    finally:
        graph.close()
        session.close()
        peer.close()
