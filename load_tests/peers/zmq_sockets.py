"""pyzmq: PUB to SUB with a topic frame; XPUB_NODROP, so that the publisher waits at the high-water mark."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any

import zmq

__all__ = ["receiver", "sender"]

_QUEUED_BYTES = 64 << 20
_QUEUED = 1000  # pyzmq's own default


def _hwm(job: dict[str, Any]) -> int:
    """How many messages may wait on a side."""
    return max(4, min(_QUEUED, _QUEUED_BYTES // job["size"]))


def _socket(kind: int, hwm: int) -> zmq.Socket[bytes]:
    socket = zmq.Context.instance().socket(kind)
    socket.set_hwm(hwm)
    return socket


def _endpoint(job: dict[str, Any], topic: str) -> str:
    """Where the topic's publisher is bound."""
    return f"tcp://127.0.0.1:{job['ports'][1 if topic == 'pong' else 0]}"


def sender(job: dict[str, Any], topic: str) -> Callable[[], object]:
    """`send_multipart` of a bound publisher."""
    socket = _socket(zmq.PUB, _hwm(job))
    socket.setsockopt(zmq.XPUB_NODROP, 1)
    socket.bind(_endpoint(job, topic))
    return functools.partial(socket.send_multipart, [topic.encode(), b"x" * job["size"]])


@functools.cache
def _receiving(endpoint: str, hwm: int) -> tuple[zmq.Socket[bytes], dict[bytes, Callable[[], object]]]:
    """One socket and one thread that receives and calls: what a pyzmq program has instead of callbacks."""
    socket = _socket(zmq.SUB, hwm)
    socket.connect(endpoint)
    callbacks: dict[bytes, Callable[[], object]] = {}

    def run() -> None:
        receive = socket.recv_multipart
        while True:
            topic, _ = receive()
            callbacks[topic]()

    threading.Thread(target=run, daemon=True).start()
    return socket, callbacks


def receiver(job: dict[str, Any], topic: str, callback: Callable[[], object]) -> None:
    """One more topic of the process's socket."""
    socket, callbacks = _receiving(_endpoint(job, topic), _hwm(job))
    callbacks[topic.encode()] = callback
    socket.subscribe(topic.encode())
