"""Sound devices by PortAudio, as drivers use them: found anew at each opening, UnavailableError when they are gone.

PortAudio lists the devices when it is initialised, and its opening and closing are not thread-safe: both are done
under one lock here, and the list is made anew whenever no stream of this process is open.
"""

from __future__ import annotations

import contextlib
import threading
from types import ModuleType
from typing import Any, Final, Literal

from metaros.clock import Clock
from metaros.drivers.context import DriverContext
from metaros.errors import ConfigError, UnavailableError

__all__ = ["PACKET_S", "Pacer", "SoundStream"]

PACKET_S: Final = 0.02
LATENCY_S: Final = 0.06  # of the device's own buffer
STUCK_S: Final = 2.0
_POLL_S: Final = 0.005
_AHEAD_S: Final = 0.06

_lock = threading.Lock()
_open: set[int] = set()


class SoundStream:
    """One open input or output of 16-bit samples, interleaved; its methods are for the driver's thread."""

    def __init__(
        self, context: DriverContext, direction: Literal["input", "output"], *, rate: int, channels: int
    ) -> None:
        """Open the parameter `device`: "" is the default, a number is PortAudio's, a text part of a name.

        Raises:
            UnavailableError: no such device now, or it cannot be used so.
            ConfigError: PortAudio itself is not installed.
        """
        portaudio = _portaudio()
        self._context = context
        self._errors = portaudio.PortAudioError
        self.frames = round(rate * PACKET_S)
        self.blocked = False  # whether the device was waited for at the last packet
        device = str(context["device"]).strip()
        make = portaudio.RawInputStream if direction == "input" else portaudio.RawOutputStream
        self._stream: Any = None
        with _lock:
            try:
                if not _open:
                    portaudio._terminate()
                    portaudio._initialize()
                chosen = int(device) if device.isdecimal() else device or None
                self.name = str(portaudio.query_devices(chosen, direction)["name"])
                self._stream = make(
                    samplerate=rate, device=chosen, channels=channels, dtype="int16", blocksize=0, latency=LATENCY_S
                )
                _open.add(id(self))
                self._stream.start()
            except (portaudio.PortAudioError, ValueError, OSError) as error:
                self._shut()
                raise UnavailableError(f"{device or 'the default device'}: {_reason(error)}") from None

    def read(self) -> tuple[bytes, int, bool]:
        """PACKET_S of sound, its frames that still wait in the device, and whether some were lost before it."""
        self._await("read_available")
        try:
            data, lost = self._stream.read(self.frames)
            return bytes(data), int(self._stream.read_available), bool(lost)
        except (self._errors, AttributeError) as error:
            raise UnavailableError(f"{self.name}: {_reason(error)}") from None

    def write(self, data: bytes) -> bool:
        """Play PACKET_S of sound; whether the device had run dry before it."""
        self._await("write_available")
        try:
            return bool(self._stream.write(data))
        except (self._errors, AttributeError) as error:
            raise UnavailableError(f"{self.name}: {_reason(error)}") from None

    def close(self) -> None:
        """Let the device go; also twice."""
        with _lock:
            self._shut()

    def _shut(self) -> None:
        stream, self._stream = self._stream, None
        _open.discard(id(self))
        if stream is not None:
            with contextlib.suppress(self._errors):
                stream.close(ignore_errors=True)

    def _await(self, available: str) -> None:
        """Wait by looking, so that a device that hangs is noticed and a driver that stops need not wait."""
        clock = self._context.clock
        until_s, self.blocked = clock.monotonic_s() + STUCK_S, False
        try:
            while getattr(self._stream, available) < self.frames:
                self.blocked = True
                if self._context.wait(_POLL_S):
                    return
                if clock.monotonic_s() > until_s:
                    raise UnavailableError(f"{self.name}: no sound moved for {STUCK_S:g} s")
        except self._errors as error:
            raise UnavailableError(f"{self.name}: {_reason(error)}") from None


class Pacer:
    """Keeps a device that never blocks (ALSA's null and file) at its rate; one that does sets the pace itself."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._due_s = clock.monotonic_s()

    def ahead_s(self, *, blocked: bool) -> float:
        """After each packet: how long to wait; 0 where the device was waited for."""
        now_s = self._clock.monotonic_s()
        self._due_s = now_s if blocked else max(self._due_s + PACKET_S, now_s)
        return max(0.0, self._due_s - now_s - _AHEAD_S)


def _portaudio() -> ModuleType:
    try:
        import sounddevice
    except OSError as error:  # the library is of the system
        raise ConfigError(f"{error}: install it, on Debian by `apt install libportaudio2`") from None
    module: ModuleType = sounddevice
    return module


def _reason(error: Exception) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
