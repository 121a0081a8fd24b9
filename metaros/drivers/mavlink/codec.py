"""MAVLink frames out of a stream of bytes, whatever comes, and into bytes. pymavlink's dialect does the rest.

Source: mavlink.io, "Packet Serialization" and "Message Signing". The dialect's own stream parser gives up the whole
length that a broken frame claimed; this one goes on one byte later, so that garbage hides at most itself.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

from metaros.errors import ConfigError

__all__ = ["MAX_FRAME", "Codec", "signing_key"]

MAX_FRAME: Final = 10 + 255 + 2 + 13
_MARKS: Final = {0xFE: 8, 0xFD: 12}  # MAVLink 1 and 2: the first byte, and what is not payload
_SIGNED: Final = 0x01
_SIGNATURE: Final = 13
_SIGNING_EPOCH_NS: Final = 1_420_070_400 * 10**9  # 2015-01-01; its unit is ten microseconds
_RADIO_STATUS: Final = 109  # from telemetry radios, which hold no key


class Codec:
    """One link's two directions. `count(name)` is told `garbage_bytes`, `bad_frames`, `unknown_messages`.

    With a `key` (32 bytes) all that is sent is signed, and what is not signed by that key, or replayed, is a bad frame.
    """

    def __init__(self, *, system: int, component: int, count: Callable[..., object], key: bytes, wall_ns: int) -> None:
        self._mav: Any = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self._count = count
        self._buffer = bytearray()
        self._lock = threading.Lock()
        if key:
            signing = self._mav.signing
            signing.secret_key, signing.sign_outgoing = key, True
            signing.timestamp = max(0, wall_ns - _SIGNING_EPOCH_NS) // 10_000
            signing.allow_unsigned_callback = lambda _, message_id: message_id == _RADIO_STATUS

    def pack(self, message: Any) -> bytes:
        """A message of the dialect as it goes over the wire; from any thread."""
        with self._lock:
            data = bytes(message.pack(self._mav))
            self._mav.seq = (self._mav.seq + 1) % 256
        return data

    def feed(self, data: bytes) -> Iterator[Any]:
        """The messages that are whole now."""
        buffer = self._buffer
        buffer += data
        while (size := self._front()) is not None:
            message = self._decoded(buffer[:size], more=buffer[size : size + 1])
            if message is None:
                del buffer[0]
                self._count("bad_frames")
                continue
            del buffer[:size]
            if isinstance(message, dialect.MAVLink_unknown):
                self._count("unknown_messages")
            else:
                yield message

    def clear(self) -> None:
        """Forget a begun frame."""
        self._buffer.clear()

    def _front(self) -> int | None:
        """Skip to the next mark; the size of a frame that is there as a whole."""
        buffer = self._buffer
        skip = next((i for i, byte in enumerate(buffer) if byte in _MARKS), len(buffer))
        if skip:
            self._count("garbage_bytes", skip)
            del buffer[:skip]
        if len(buffer) < 3:
            return None
        size = _MARKS[buffer[0]] + buffer[1]
        if buffer[0] == 0xFD and buffer[2] & _SIGNED:
            size += _SIGNATURE
        return size if len(buffer) >= size else None

    def _decoded(self, frame: bytearray, *, more: bytearray) -> Any:
        if frame[0] == 0xFD and frame[2] & ~_SIGNED:
            return None  # flags that change the format in a way nobody knows yet
        stamps = self._mav.signing.stream_timestamps
        before = dict(stamps)
        try:
            with self._lock:
                message = self._mav.decode(frame)
        except dialect.MAVError:
            stamps.clear()  # pymavlink notes the time of a forged frame too, which would shut out the true sender
            stamps.update(before)
            return None
        if isinstance(message, dialect.MAVLink_unknown) and (
            self._mav.signing.secret_key or (more and more[0] not in _MARKS)
        ):
            return None  # its checksum cannot be checked, so what follows must look like a frame
        return message


def signing_key(text: str, where: str) -> bytes:
    """The key in a file: 64 hexadecimal digits. ConfigError where it is none; the text is not told."""
    try:
        key = bytes.fromhex(text.strip())
    except ValueError:
        key = b""
    if len(key) != 32:
        raise ConfigError(f"{where}: a signing key is 64 hexadecimal digits")
    return key
