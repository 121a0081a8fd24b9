"""The driver: one thread reads the board, one writes to it."""

from __future__ import annotations

import threading
from typing import Final

from metaros.drivers.context import DriverContext
from metaros.drivers.serial.channels import Channels
from metaros.drivers.serial.framing import OVERHEAD_BYTES, Frame, FrameSplitter, encode_frame
from metaros.drivers.serial.outgoing import Outgoing
from metaros.drivers.serial.protocol import VERSION, Answer, FromBoard, ToBoard, parse_declare, parse_hello, pong
from metaros.drivers.serial_port import SerialPort
from metaros.errors import DecodeError, UnavailableError

__all__ = ["BoardDevice", "make"]

ASK_EVERY_S: Final = 1.0
QUIET_S: Final = 2.0
MAX_LOG: Final = 256
LOGS_A_SECOND: Final = 20
_LEVELS: Final = {10: "debug", 20: "info", 30: "warn", 40: "error", 50: "error"}


def make(context: DriverContext) -> BoardDevice:
    """A board on the serial port of the parameters."""
    return BoardDevice(context)


class BoardDevice:
    """Asks the board who it is, opens the topics that it declares, and carries messages both ways."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._port: SerialPort | None = None
        self._outgoing = Outgoing(context.count)
        self._channels = Channels(context, self._outgoing)
        self._boot: int | None = None
        self._received_s = self._asked_s = self._log_s = 0.0
        self._logs = 0

    def open(self) -> None:
        """Open the port; the board is there once it says hello."""
        self._port = SerialPort(self._context, self._context["port"], self._context["baud"])
        self._port.discard()
        self._boot = None
        self._received_s = self._context.clock.monotonic_s()
        self._asked_s = 0.0

    def run(self) -> None:
        """Read until the driver stops; the writer ends with it."""
        port, context = self._port, self._context
        assert port is not None
        splitter = FrameSplitter(max_bytes=context["max_frame_bytes"], count=context.count)
        ended = threading.Event()
        writer = threading.Thread(target=self._write, args=(port, ended), name="serial writer", daemon=True)
        writer.start()
        try:
            while not context.stopping:
                if ended.is_set():
                    raise UnavailableError(f"{port.port}: cannot be written to")
                for frame in splitter.feed(port.read()):
                    self._received_s = context.clock.monotonic_s()
                    self._take(frame)
                self._ask()
        finally:
            ended.set()
            writer.join(2.0)

    def close(self) -> None:
        """Close the port and the board's topics."""
        port, self._port = self._port, None
        if port is not None:
            port.close()
        self._channels.close()

    # -- from the board --------------------------------------------------------------------------------------------

    def _take(self, frame: Frame) -> None:
        context = self._context
        context.count("frames")
        try:
            if frame.kind == FromBoard.HELLO:
                self._hello(frame.payload)
            elif frame.kind == FromBoard.DECLARE:
                self._declare(frame)
            elif frame.kind == FromBoard.DATA:
                self._channels.publish(frame.channel, frame.payload)
            elif frame.kind == FromBoard.LOG:
                self._log(frame)
            elif frame.kind == FromBoard.PING:
                self._outgoing.control(encode_frame(ToBoard.PONG, 0, pong(frame.payload, context.clock.wall_ns())))
            else:
                raise DecodeError(f"frame of kind {frame.kind:#04x}, which no board sends")
        except DecodeError as error:
            context.count("bad_message")
            context.fact("last_bad_message", str(error)[:200])

    def _hello(self, payload: bytes) -> None:
        hello = parse_hello(payload)
        if hello.boot != self._boot:
            if self._boot is not None:
                self._context.count("board_restarts")
            self._boot = hello.boot
            self._channels.close()
            assert self._port is not None
            self._context.opened(f"{hello.name or 'board'} on {self._port.port}", hardware_id=hello.name)

    def _declare(self, frame: Frame) -> None:
        wanted = parse_declare(frame.channel, frame.payload)
        if self._boot is None:
            return  # it was not asked yet; it declares once more when it is
        answer = self._channels.declare(wanted)
        self._context.fact("topics", len(self._channels))
        if answer is not Answer.ACCEPTED:
            self._context.count("refused_topics")
            self._context.warn(f"{wanted.topic} ({wanted.type_name}): {answer.name.lower().replace('_', ' ')}")
        self._outgoing.control(encode_frame(ToBoard.ANSWER, frame.channel, bytes((answer,))))

    def _log(self, frame: Frame) -> None:
        now_s = self._context.clock.monotonic_s()
        if now_s - self._log_s >= 1.0:
            self._log_s, self._logs = now_s, 0
        self._logs += 1
        if self._logs > LOGS_A_SECOND:
            self._context.count("logs_skipped")
            return
        text = frame.payload[:MAX_LOG].decode(errors="replace")
        getattr(self._context.log, _LEVELS.get(frame.channel, "info"))(
            "board: " + "".join(char if char.isprintable() else " " for char in text)
        )

    # -- to the board ----------------------------------------------------------------------------------------------

    def _ask(self) -> None:
        """Ask until it says hello, and again when it has been quiet."""
        now_s = self._context.clock.monotonic_s()
        known = self._boot is not None and now_s - self._received_s < QUIET_S
        if not known and now_s - self._asked_s >= ASK_EVERY_S:
            self._asked_s = now_s
            self._outgoing.control(encode_frame(ToBoard.ASK, 0, bytes((VERSION,))))

    def _write(self, port: SerialPort, ended: threading.Event) -> None:
        try:
            port.write(b"\0")  # ends whatever a broken session left in the board
            while not ended.is_set():
                item = self._outgoing.take(0.1)
                if isinstance(item, tuple):
                    channel, data = item
                    if len(data) + OVERHEAD_BYTES > self._context["max_frame_bytes"]:
                        self._context.count("too_long_for_board")
                        continue
                    item = encode_frame(ToBoard.DATA, channel, data)
                    self._context.count("sent")
                if item:
                    port.write(item)
        except UnavailableError:
            pass
        finally:
            ended.set()
