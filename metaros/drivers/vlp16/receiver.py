"""The thread that takes a VLP-16's packets off the wire, at once and always, into a bounded queue of turns."""

from __future__ import annotations

import contextlib
import selectors
import socket
import sys
import threading
from collections import Counter, deque
from typing import Final

from metaros.drivers.context import DriverContext
from metaros.drivers.vlp16.position import Position, parse_position
from metaros.drivers.vlp16.revolutions import RawRevolution, RevolutionSplitter
from metaros.errors import ConfigError, UnavailableError

__all__ = ["BUFFER_BYTES", "QUEUE_TURNS", "Receiver"]

BUFFER_BYTES: Final = 4 << 20  # asked of the kernel: three seconds of packets; it may grant less
QUEUE_TURNS: Final = 30  # with delivery=all: three seconds at 10 Hz
_LOOK_S: Final = 0.1
_MOST_BYTES: Final = 65_536 if sys.platform == "win32" else 2048  # Windows makes an error of what does not fit


class Receiver:
    """Listens from its making until `close`. `newest_only`: a turn that waits is replaced by the next one."""

    def __init__(
        self, context: DriverContext, *, bind: str, port: int, position_port: int, device: str, newest_only: bool
    ) -> None:
        """Raises UnavailableError: the address is not there, or taken; ConfigError: it is none."""
        self._context = context
        self._device = device
        self._turns: deque[RawRevolution] = deque()
        self._room = 1 if newest_only else QUEUE_TURNS
        self._overflow = "skipped_turns" if newest_only else "dropped_turns"
        self._changed = threading.Condition()
        self._cutter = RevolutionSplitter()
        self._reported: Counter[str] = Counter()
        self._stop = threading.Event()
        self._failure = ""
        self._data = _bound(bind, port)
        self.port = int(self._data.getsockname()[1])
        self._position: socket.socket | None = None
        try:
            if position_port:
                self._position = _bound(bind, position_port)
        except BaseException:
            self._data.close()
            raise
        self._thread = threading.Thread(target=self._listen, name=f"vlp16 {self.port}", daemon=True)
        self._thread.start()

    @property
    def buffer_bytes(self) -> int:
        """What the kernel granted."""
        return int(self._data.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF))

    def take(self, timeout_s: float) -> RawRevolution | None:
        """The oldest turn that waits; None when none came. UnavailableError where listening has ended."""
        with self._changed:
            self._changed.wait_for(lambda: self._turns or self._failure, timeout_s)
            if self._turns:
                return self._turns.popleft()
        if self._failure:
            raise UnavailableError(self._failure)
        return None

    def close(self) -> None:
        """Stop listening; what waits is forgotten."""
        self._stop.set()
        self._thread.join(2.0)
        for one in (self._data, self._position):
            if one is not None:
                one.close()

    def _listen(self) -> None:
        with selectors.DefaultSelector() as selector:
            for one in (self._data, self._position):
                if one is not None:
                    selector.register(one, selectors.EVENT_READ)
            try:
                while not self._stop.is_set():
                    for key, _ in selector.select(_LOOK_S):
                        self._drain(self._data if key.fileobj is self._data else self._position)
                    self._report()
            except OSError as error:
                with self._changed:
                    self._failure = f"UDP {self.port}: {error.strerror or error}"
                    self._changed.notify_all()

    def _drain(self, wire: socket.socket | None) -> None:
        assert wire is not None
        for _ in range(256):  # then the counters are told
            try:
                data, sender = wire.recvfrom(_MOST_BYTES)
            except (BlockingIOError, ConnectionResetError):  # the latter: Windows, of a packet that we never sent
                return
            if self._device and sender[0] != self._device:
                self._cutter.counters["foreign_packets"] += 1
                continue
            data = self._context.heard(data)
            if wire is self._position:
                self._note(parse_position(data))
            elif turn := self._cutter.add(data, self._context.clock.wall_ns()):
                self._give(turn)

    def _give(self, turn: RawRevolution) -> None:
        with self._changed:
            if len(self._turns) >= self._room:
                self._turns.popleft()
                self._context.count(self._overflow)
            self._turns.append(turn)
            self._changed.notify()

    def _note(self, position: Position | None) -> None:
        if position is None:
            self._cutter.counters["wrong_position"] += 1
            return
        self._context.fact("pps", position.pps)
        self._context.fact("gps", position.gps)
        if position.utc:
            self._context.fact("gps_utc", position.utc)

    def _report(self) -> None:
        found = Counter(self._cutter.counters)
        for name, by in (found - self._reported).items():
            self._context.count(name, by)
        self._reported = found


def _bound(bind: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(bind, port, type=socket.SOCK_DGRAM, flags=socket.AI_NUMERICHOST)[0][0]
    except socket.gaierror:
        raise ConfigError(f"vlp16: bind: {bind!r} is no address of this machine, such as 0.0.0.0") from None
    made = socket.socket(family, socket.SOCK_DGRAM)
    try:
        with contextlib.suppress(OSError):
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        made.setblocking(False)
        made.bind((bind, port))
    except OSError as error:
        made.close()
        raise UnavailableError(f"UDP {bind}:{port}: {error.strerror}") from None
    return made
