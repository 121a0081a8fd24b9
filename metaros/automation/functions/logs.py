"""What a worker writes, cut into messages and put down to its calls: bounded in each of them, and in its rate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from metaros.automation.functions.calls import FunctionSpec
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["FrameReader", "LineReader", "LogPiece", "WorkerLog"]

_HEAD = 16  # type, length, stamp
_MAGIC = b"\xa5\x5a"


@dataclass(frozen=True, slots=True)
class LogPiece:
    """One or more whole messages of a worker. `request_id` is "" for what it wrote while no call was under way."""

    function: str
    version: str
    key: str
    worker: str
    request_id: str
    at_ns: int
    text: str


class FrameReader:
    """The framed descriptor: type, length, microseconds, message. A longer message than `most_bytes` is cut; what is
    no frame (the descriptor is open to the handler too) is passed on as it is.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._held = b""
        self._skip_bytes = 0
        self._broken = False

    def feed(self, data: bytes) -> list[bytes]:
        """The messages that are whole now, each with a line end."""
        if self._broken:
            return [data]
        data = self._held + data
        at = 0  # moved along: a cut for each of thousands of frames would copy the rest as often
        messages: list[bytes] = []
        while len(data) - at >= _HEAD or self._skip_bytes:
            skipped = min(self._skip_bytes, len(data) - at)
            self._skip_bytes -= skipped
            at += skipped
            if self._skip_bytes or len(data) - at < _HEAD:
                break
            if data[at : at + 2] != _MAGIC:
                self._broken, self._held = True, b""
                return [*messages, data[at:]]
            size = int.from_bytes(data[at + 4 : at + 8], "big")
            kept = min(size, self._most_bytes)
            if len(data) - at < _HEAD + kept:
                break
            at += _HEAD
            message = data[at : at + kept]
            messages.append(message if message.endswith(b"\n") else message + b"\n")
            at, self._skip_bytes = at + kept, size - kept
        self._held = data[at:]
        return messages


class LineReader:
    """Plain output: whole lines; a longer one than `most_bytes` is broken."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._held = b""

    def feed(self, data: bytes) -> bytes:
        """The lines that are whole now."""
        data = self._held + data
        end = data.rfind(b"\n") + 1
        self._held = data[end:]
        if len(self._held) > self._most_bytes:
            return data[:end] + self.flush()
        return data[:end]

    def flush(self) -> bytes:
        """What is left of a line, as one."""
        held, self._held = self._held, b""
        return held + b"\n" if held else b""


class WorkerLog:
    """The log of one worker. What it writes while it has no call comes with the next one."""

    def __init__(
        self,
        spec: FunctionSpec,
        worker: str,
        *,
        emit: Callable[[LogPiece], None],
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._spec, self._worker, self._emit, self._clock = spec, worker, emit, clock
        self._most_bytes = limits.function_call_log_bytes
        self._tail_bytes = limits.function_tail_bytes
        self._frames = FrameReader(limits.function_log_message_bytes)
        self._lines = LineReader(limits.function_log_message_bytes)
        self._request_id = ""
        self._start = b""  # the START line, until something follows it
        self._tail = bytearray()
        self._seen_bytes = 0

    def framed(self, data: bytes) -> None:
        """Bytes of the framed descriptor."""
        self._add(b"".join(self._frames.feed(data)))

    def plain(self, data: bytes) -> None:
        """Bytes of stdout and stderr."""
        self._add(self._lines.feed(data))

    def note(self, text: str) -> None:
        """A line of the platform's, of what concerns whoever wrote the function."""
        self._add(f"[{text}]\n".encode())

    def begin(self, request_id: str) -> None:
        """A call begins."""
        self._request_id = request_id
        self._seen_bytes = 0
        self._start = f"START RequestId: {request_id} Version: {self._spec.version}\n".encode()

    def end(self, last: str) -> bytes:
        """The call is over, `last` are its last lines; the end of its whole log."""
        text = self._start + self._lines.flush() + last.encode()
        self._start = b""
        self._put(text)
        tail = bytes(self._tail[-self._tail_bytes :])
        self._tail.clear()
        self._request_id, self._seen_bytes = "", 0
        return tail

    def _add(self, text: bytes) -> None:
        if not text or self._seen_bytes > self._most_bytes:
            return
        self._seen_bytes += len(text)
        if self._seen_bytes > self._most_bytes:
            text = f"[the log of this call is over {self._most_bytes} bytes: the rest is dropped]\n".encode()
        text, self._start = self._start + text, b""
        self._put(text)

    def _put(self, text: bytes) -> None:
        self._tail += text[-self._tail_bytes :]
        if len(self._tail) > 4 * self._tail_bytes:
            del self._tail[: -self._tail_bytes]
        spec = self._spec
        shown = text.decode("utf-8", "replace")
        at_ns = self._clock.wall_ns()
        self._emit(LogPiece(spec.name, spec.version, spec.key, self._worker, self._request_id, at_ns, shown))
