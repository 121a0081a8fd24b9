"""The hub that ZeroMQ programs connect to: publishers to its XSUB, subscribers to its XPUB.

Two of libzmq's own forwarding loops in a row, each on a thread that never takes the GIL: what ZeroMQ publishers say
passes both, and what the bridge says joins between them. So the bridge receives only ZeroMQ's messages, never its own:

    publishers ─▶ XSUB ═▶ XPUB ───▶ XSUB ═▶ XPUB ─▶ subscribers
                        │             ▲
                        ▼             │
                       received   outbound (the two sockets of the bridge)

The first loop copies each message to `received` by reference, but for those that begin as the bridge said it does not
want to see: of these only the number is known. A flood that nobody in ROS listens to so costs Python nothing.

Frames are opaque here. A subscriber that is `hwm` messages behind misses newer ones; libzmq does not tell how many.
"""

from __future__ import annotations

import struct
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import zmq

from metaros.errors import ConfigError
from metaros.limits import LIMITS

__all__ = ["Hub", "HubOptions", "HubTotals", "endpoint"]

_MIDDLE: Final = "inproc://middle"
_RECEIVED: Final = "inproc://received"
_OUTBOUND: Final = "inproc://outbound"
_CONTROL: Final = "inproc://control"
_TRANSPORTS: Final = ("tcp", "ipc")
_EVERYTHING: Final = b"\x01"  # ZeroMQ's frame of a subscription to the empty prefix
_SUBSCRIPTIONS: Final = 4  # where the answer to STATISTICS has what came from the subscribers' side


@dataclass(frozen=True, slots=True, kw_only=True)
class HubOptions:
    """Where publishers (`xsub`) and subscribers (`xpub`) connect; `hwm` messages may wait for each."""

    xsub: tuple[str, ...] = ("tcp://127.0.0.1:5555",)
    xpub: tuple[str, ...] = ("tcp://127.0.0.1:5556",)
    hwm: int = 1000


@dataclass(frozen=True, slots=True)
class HubTotals:
    """What came from ZeroMQ publishers since the beginning, and how many subscriptions passed the other way."""

    frames: int = 0
    bytes: int = 0
    subscriptions: int = 0


def endpoint(text: str, *, host: str = "127.0.0.1") -> str:
    """`5555`, `tcp://0.0.0.0:5555` or `ipc:///run/robot.sock` as ZeroMQ's endpoint; ConfigError otherwise."""
    if text.isascii() and text.isdigit():
        text = f"tcp://{host}:{text}"
    transport, separator, address = text.partition("://")
    if not separator or transport not in _TRANSPORTS or not address:
        raise ConfigError(f"{text!r} is no ZeroMQ endpoint: a port, tcp://ADDRESS:PORT or ipc://PATH")
    if transport == "ipc" and not zmq.has("ipc"):
        raise ConfigError(f"{text}: ZeroMQ has no ipc on this platform ({sys.platform}): use tcp")
    port = address.rpartition(":")[2]
    if transport == "tcp" and not (port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise ConfigError(f"{text}: a TCP endpoint ends in a port within 1..65535")
    return text


class Hub:
    """A running hub. `received` receives the messages of ZeroMQ publishers, `outbound` sends to every subscriber.

    `outbound` also receives the subscriptions, and `received` sees them pass: frames that begin with 0 or 1 are either
    these or messages without a topic. Both sockets belong to the one thread that uses them.
    """

    def __init__(self, options: HubOptions) -> None:
        self._context = zmq.Context()
        self._hwm = options.hwm
        self._threads: list[threading.Thread] = []
        self._totals = HubTotals()
        try:
            self._open(options)
        except BaseException:
            self._context.destroy(linger=0)
            raise

    def _open(self, options: HubOptions) -> None:
        front, middle, merge, back, copies, control = (
            self._socket(kind) for kind in (zmq.XSUB, zmq.XPUB, zmq.XSUB, zmq.XPUB, zmq.PUB, zmq.PAIR)
        )
        front.maxmsgsize = LIMITS.broker_message_bytes
        self.received, self.outbound, self.control = (self._socket(kind) for kind in (zmq.SUB, zmq.XPUB, zmq.PAIR))
        self.received.rcvhwm = max(10 * self._hwm, 10_000)  # while the bridge converts one large message
        copies.invert_matching = self.received.invert_matching = True  # a subscription says what is left out
        control.bind(_CONTROL)
        self.control.connect(_CONTROL)
        copies.bind(_RECEIVED)
        self.received.connect(_RECEIVED)
        middle.bind(_MIDDLE)
        self.outbound.bind(_OUTBOUND)
        merge.connect(_MIDDLE)
        merge.connect(_OUTBOUND)
        front.send(_EVERYTHING)  # of every publisher, whoever subscribes: the bridge must learn of their topics
        for socket, endpoints in ((front, options.xsub), (back, options.xpub)):
            for where in endpoints:
                _bind(socket, where)
        self._forward(
            *("metaros-zmq-in", front, middle),
            lambda: zmq.proxy_steerable(front, middle, copies, control),
            *(copies, control),
        )
        self._forward("metaros-zmq-out", merge, back, lambda: zmq.proxy(merge, back))

    def _socket(self, kind: int) -> Any:
        socket: Any = self._context.socket(kind)
        socket.linger = 0
        socket.rcvhwm = socket.sndhwm = self._hwm
        return socket

    def _forward(self, name: str, one: Any, other: Any, loop: Callable[[], object], *more: Any) -> None:
        def run() -> None:
            with suppress(zmq.ContextTerminated):
                loop()
            for socket in (one, other, *more):
                socket.close()

        thread = threading.Thread(target=run, name=name, daemon=True)
        thread.start()
        self._threads.append(thread)

    def ignore(self, prefix: bytes) -> None:
        """Leave messages that begin so out of `received`, from a moment on."""
        self.received.subscribe(prefix)

    def heed(self, prefix: bytes) -> None:
        """The reverse of one `ignore`."""
        self.received.unsubscribe(prefix)

    def ask_totals(self) -> None:
        """Have the hub count what it has forwarded; the answer arrives on `control`."""
        with suppress(zmq.Again):
            self.control.send(b"STATISTICS", zmq.NOBLOCK)

    def read_totals(self) -> HubTotals:
        """The newest answer."""
        with suppress(zmq.Again):
            while True:
                answer = self.control.recv_multipart(zmq.NOBLOCK)
                counts = [struct.unpack("=Q", part)[0] for part in answer]
                self._totals = HubTotals(counts[0], counts[1], counts[_SUBSCRIPTIONS])
        return self._totals

    def close(self) -> None:
        """End both loops; messages under way are lost. Call it after the bridge's end."""
        for socket in (self.received, self.outbound, self.control):
            socket.close()
        self._context.term()
        for thread in self._threads:
            thread.join()


def _bind(socket: Any, where: str) -> None:
    try:
        if "[" in where:
            socket.ipv6 = True
        socket.bind(where)
    except zmq.ZMQError as error:
        raise ConfigError(f"cannot listen on {where}: {error.strerror}") from None
