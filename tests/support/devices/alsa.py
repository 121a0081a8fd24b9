"""Sound devices without hardware: an ALSA configuration whose microphone reads a file and whose speaker writes one.

ALSA's null device never blocks and has no clock: how fast sound goes is the driver's own affair.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

__all__ = ["Alsa", "strongest_hz", "tone"]

MIC, SPEAKER = "testmic", "testspeaker"
_BASE = "pcm.nothing { type null }\npcm.!default { type null }\nctl.!default { type null }\n"


class Alsa:
    """The devices `testmic` and `testspeaker`; `remove` and `restore` are unplugging and replugging."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.config, self.heard, self.said = folder / "asound.conf", folder / "speaker.raw", folder / "mic.raw"
        self.restore()
        monkeypatch.setenv("ALSA_CONFIG_PATH", str(self.config))

    def restore(self) -> None:
        """Both devices are there."""
        self._write(
            f'pcm.{SPEAKER} {{ type file slave.pcm "nothing" file "{self.heard}" format "raw" }}\n'
            f'pcm.{MIC} {{ type file slave.pcm "nothing" file "/dev/null" infile "{self.said}" format "raw" }}\n'
        )

    def remove(self) -> None:
        """Neither is; the machine's default, which is silence, stays: PortAudio aborts where there is no device."""
        self._write("")

    def say(self, samples: npt.NDArray[np.int16]) -> None:
        """What the microphone hears."""
        self.said.write_bytes(samples.astype("<i2").tobytes())

    def played(self) -> npt.NDArray[np.int16]:
        """What the speaker has played so far."""
        data = self.heard.read_bytes() if self.heard.exists() else b""
        return np.frombuffer(data[: len(data) // 2 * 2], "<i2")

    def _write(self, devices: str) -> None:
        draft = self.config.with_suffix(".new")
        draft.write_text(_BASE + devices)
        draft.rename(self.config)


def tone(hz: float, seconds: float, rate: int, *, level: float = 0.5) -> npt.NDArray[np.int16]:
    """A sine."""
    return np.rint(32767 * level * np.sin(2 * np.pi * hz * np.arange(round(seconds * rate)) / rate)).astype(np.int16)


def strongest_hz(samples: npt.NDArray[np.int16], rate: int) -> tuple[float, float]:
    """The strongest frequency of what is not silence, and which part of the power is within 5 Hz of it."""
    loud = np.flatnonzero(np.abs(samples.astype(np.int32)) > 200)
    if len(loud) < rate // 2:
        return 0.0, 0.0
    piece = samples[loud[0] : loud[-1] + 1].astype(np.float64)
    power = np.square(np.abs(np.fft.rfft(piece * np.hanning(len(piece)))))
    bins = np.fft.rfftfreq(len(piece), 1 / rate)
    best = float(bins[np.argmax(power)])
    return best, float(power[np.abs(bins - best) <= 5].sum() / power.sum())
