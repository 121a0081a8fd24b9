"""Many WebSocket viewers in one process: raw sockets under epoll, so that the client costs little beside the server.

It counts every message of every viewer and takes the latency of each, from a stamp in its first eight bytes. Messages
have one size, so a server's frames are walked by arithmetic.
"""

from __future__ import annotations

import base64
import contextlib
import os
import select
import socket
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

__all__ = ["FoxgloveViewer", "JsonViewer", "RosbridgeViewer", "StreamViewer", "Taken", "Viewer", "take"]

_READ_BYTES = 1024 * 1024
_STAMP = struct.Struct("<Q")
_QUICKACK = getattr(socket, "TCP_QUICKACK", None)
_RECORD_HEADER = 40


@dataclass
class Taken:
    """What all viewers together took: messages by viewer, latencies in ns, and the client's own CPU time."""

    counts: list[int] = field(default_factory=list)
    latencies_ns: list[int] = field(default_factory=list)
    cpu_s: float = 0.0
    wall_s: float = 0.0


class Viewer:
    """One connection, already upgraded and subscribed; `feed` gets what was read."""

    path = "/"
    protocol = ""

    def __init__(self, port: int, *, size: int) -> None:
        self.size = size
        self.count = 0
        self.rest = b""
        while not self._open(port):
            time.sleep(0.2)  # a gateway lets one address open only so many a second
        self.subscribe()

    def subscribe(self) -> None:
        """Ask for the one topic; returns when the server has said what it says first."""

    def feed(self, data: memoryview, now_ns: int, latencies_ns: list[int]) -> None:
        """Walk what was read; a message that comes in two pieces is put together."""
        raise NotImplementedError

    def say(self, text: str) -> None:
        """Send a text message, masked with zeros."""
        payload = text.encode()
        head = (
            bytes((0x81, 0x80 | len(payload))) if len(payload) < 126 else b"\x81\xfe" + len(payload).to_bytes(2, "big")
        )
        self.socket.sendall(head + bytes(4) + payload)

    def hear(self) -> bytes:
        """The next whole message; only before the flood."""
        header = self._exactly(2)
        size = header[1] & 0x7F
        if size == 126:
            size = int.from_bytes(self._exactly(2), "big")
        elif size == 127:
            size = int.from_bytes(self._exactly(8), "big")
        return self._exactly(size)

    def _exactly(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            piece = self.socket.recv(size - len(data))
            if not piece:
                raise ConnectionError("the server closed")
            data += piece
        return data

    def _open(self, port: int) -> bool:
        """Connect; False: try again."""
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=60)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        status = self._upgrade(port)
        if b" 101 " in status:
            return True
        self.socket.close()
        if b" 429 " not in status:
            raise ConnectionError(status.decode("latin-1"))
        return False

    def _upgrade(self, port: int) -> bytes:
        key = base64.b64encode(os.urandom(16)).decode()
        lines = [
            f"GET {self.path} HTTP/1.1",
            f"Host: 127.0.0.1:{port}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key}",
            "Sec-WebSocket-Version: 13",
        ]
        if self.protocol:
            lines.append(f"Sec-WebSocket-Protocol: {self.protocol}")
        self.socket.sendall("\r\n".join([*lines, "", ""]).encode())
        answer = b""
        while not answer.endswith(b"\r\n\r\n"):
            answer += self._exactly(1)
        return answer.split(b"\r\n", 1)[0]


class FoxgloveViewer(Viewer):
    """Foxglove's protocol: one frame a message, all of one size."""

    path = "/"
    protocol = "foxglove.sdk.v1"

    def subscribe(self) -> None:
        """Take the first channel that is advertised."""
        while b'"advertise"' not in (message := self.hear()):
            pass
        number = int(message.split(b'"id":', 1)[1].split(b",", 1)[0])
        self.say(f'{{"op":"subscribe","subscriptions":[{{"id":7,"channelId":{number}}}]}}')
        payload = 13 + self.size
        self._head = 2 if payload < 126 else 4 if payload < 65536 else 10
        self._frame = self._head + payload
        self._at = self._head + 13

    def feed(self, data: memoryview, now_ns: int, latencies_ns: list[int]) -> None:
        """Frames of one size, one after the other."""
        if self.rest:
            data = memoryview(self.rest + bytes(data))
        frame, whole = self._frame, len(data) // self._frame
        starts = range(self._at, whole * frame, frame)
        latencies_ns.extend([now_ns - _STAMP.unpack_from(data, start)[0] for start in starts])
        self.count += whole
        self.rest = bytes(data[whole * frame :])


class _Framed(Viewer):
    """Walks WebSocket frames of any size."""

    def feed(self, data: memoryview, now_ns: int, latencies_ns: list[int]) -> None:
        """Frames as they come."""
        if self.rest:
            data = memoryview(self.rest + bytes(data))
        at, end = 0, len(data)
        while end - at >= 2:
            size, start = data[at + 1], at + 2
            if size >= 126:
                width = 2 if size == 126 else 8
                size, start = int.from_bytes(data[start : start + width], "big"), start + width
            if start + size > end:
                break
            self.message(data, data[at] & 0x0F, start, size, now_ns, latencies_ns)
            at = start + size
        self.rest = bytes(data[at:])

    def message(
        self, data: memoryview, opcode: int, start: int, size: int, now_ns: int, latencies_ns: list[int]
    ) -> None:
        """One whole message."""
        raise NotImplementedError


class StreamViewer(_Framed):
    """The gateway's stream, binary."""

    path = "/api/v1/stream"

    def subscribe(self) -> None:
        """Take the one topic, every sample."""
        self.hear()
        self.say('{"op":"subscribe","id":1,"robots":"*","topics":"/bench","mode":"queue","queue_bytes":8388608}')
        self.say('{"op":"no"}')  # its error tells that the subscription was read
        while b'"error"' not in self.hear():
            pass
        self._record = _RECORD_HEADER + (self.size + 7 & ~7)

    def message(
        self, data: memoryview, opcode: int, start: int, size: int, now_ns: int, latencies_ns: list[int]
    ) -> None:
        """Records of one size."""
        if opcode != 2:
            return
        record, end = self._record, start + size
        starts = range(start + _RECORD_HEADER, end, record)
        latencies_ns.extend([now_ns - _STAMP.unpack_from(data, at)[0] for at in starts])
        self.count += size // record


class JsonViewer(_Framed):
    """The gateway's stream, JSON: a text a sample, with the stamp as digits behind an @."""

    path = "/api/v1/stream"

    def subscribe(self) -> None:
        """Take the one topic, every sample."""
        self.hear()
        self.say('{"op":"subscribe","id":1,"robots":"*","topics":"/text","mode":"queue","encoding":"json"}')
        self.say('{"op":"no"}')
        while b'"error"' not in self.hear():
            pass

    def message(
        self, data: memoryview, opcode: int, start: int, size: int, now_ns: int, latencies_ns: list[int]
    ) -> None:
        """One sample a text."""
        text = bytes(data[start : start + size])
        found = text.find(b"@")
        if found >= 0:
            latencies_ns.append(now_ns - int(text[found + 1 : found + 21]))
            self.count += 1


class RosbridgeViewer(JsonViewer):
    """The gateway's rosbridge."""

    path = "/rosbridge"

    def subscribe(self) -> None:
        """Take the one topic, every message."""
        self.say('{"op":"subscribe","topic":"/bench/text","type":"std_msgs/String"}')
        self.say('{"op":"call_service","service":"/rosapi/get_time","id":"ready"}')
        while b'"ready"' not in self.hear():
            pass


@contextlib.contextmanager
def _polled(viewers: list[Viewer]) -> Iterator[select.epoll]:
    poll = select.epoll()
    try:
        for viewer in viewers:
            viewer.socket.setblocking(False)
            poll.register(viewer.socket.fileno(), select.EPOLLIN)
        yield poll
    finally:
        poll.close()


def take(viewers: list[Viewer], over: Callable[[], bool], *, quickack: bool) -> Taken:
    """Read everything until `over` and nothing more comes for a fifth of a second."""
    taken, buffer = Taken(), bytearray(_READ_BYTES)
    view = memoryview(buffer)
    by_file = {viewer.socket.fileno(): viewer for viewer in viewers}
    latencies, clock_ns = taken.latencies_ns, time.monotonic_ns
    began_s, cpu_s = time.monotonic(), time.process_time()
    with _polled(viewers) as poll:
        while True:
            ready = poll.poll(0.2)
            if not ready and over():
                break
            for number, _ in ready:
                viewer = by_file[number]
                size = viewer.socket.recv_into(buffer)
                if not size:
                    raise ConnectionError("a server closed a viewer")
                if quickack and _QUICKACK is not None:
                    viewer.socket.setsockopt(socket.IPPROTO_TCP, _QUICKACK, 1)
                viewer.feed(view[:size], clock_ns(), latencies)
    taken.counts = [viewer.count for viewer in viewers]
    taken.cpu_s, taken.wall_s = time.process_time() - cpu_s, time.monotonic() - began_s
    return taken
