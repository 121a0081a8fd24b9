"""Texts and files: what may be played, and what may not."""

from __future__ import annotations

import wave
from pathlib import Path

import numpy as np
import pytest

from metaros.drivers.speaker.clips import MAX_TEXT_CHARS, check_voice, load, named, spoken
from metaros.errors import ConfigError, DecodeError
from tests.support.devices.alsa import strongest_hz, tone


def write_wav(path: Path, rate: int = 22050, *, width: int = 2, channels: int = 1) -> Path:
    samples = np.repeat(tone(660, 1, rate)[:, None], channels, axis=1)
    packed = {1: (samples // 256 + 128).astype("u1"), 2: samples.astype("<i2"), 4: samples.astype("<i4") << 16}[width]
    with wave.open(str(path), "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(width)
        file.setframerate(rate)
        file.writeframes(packed.tobytes())
    return path


@pytest.mark.parametrize("width", [1, 2, 4])
@pytest.mark.parametrize("channels", [1, 2])
def test_wav_files(tmp_path: Path, width: int, channels: int) -> None:
    sound = load(write_wav(tmp_path / "a.wav", width=width, channels=channels), 48000)
    assert strongest_hz((sound * 32767).astype(np.int16), 48000)[0] == pytest.approx(660, abs=2)
    assert np.abs(sound).max() == pytest.approx(0.5, abs=0.02)


def test_other_files_by_ffmpeg(tmp_path: Path) -> None:
    path = write_wav(tmp_path / "a.wav").rename(tmp_path / "a.sound")
    assert strongest_hz((load(path, 16000) * 32767).astype(np.int16), 16000)[0] == pytest.approx(660, abs=2)


@pytest.mark.parametrize("name", ["noise.wav", "noise.mp3", "cut.wav", "empty.wav"])
def test_what_is_no_sound_is_refused(tmp_path: Path, name: str) -> None:
    whole = write_wav(tmp_path / "whole.wav").read_bytes()
    data = {"cut.wav": whole[:30], "empty.wav": b""}.get(name, np.random.default_rng(2).bytes(1_000_000))
    (tmp_path / name).write_bytes(data)
    with pytest.raises(DecodeError):
        load(tmp_path / name, 16000)


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", "../secret.wav", "/etc/passwd", "a/b.wav", "..\\a.wav", ".hidden", "link.wav", "a\0b", "x" * 300],
)
def test_nothing_outside_the_folder_can_be_named(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "sounds"
    folder.mkdir()
    write_wav(tmp_path / "secret.wav")
    write_wav(folder / ".hidden")
    (folder / "link.wav").symlink_to(tmp_path / "secret.wav")
    good = write_wav(folder / "good one.wav")
    assert named(str(folder), "good one.wav") == good
    with pytest.raises(DecodeError):
        named(str(folder), name)
    with pytest.raises(DecodeError, match="names no folder"):
        named("", "good one.wav")


def test_a_text_is_spoken() -> None:
    sound = spoken("-f /etc/passwd; $(reboot) hello", check_voice("en-gb"), 16000)
    assert 1 < len(sound) / 16000 < 20
    assert np.abs(sound).max() > 0.1


def test_texts_and_voices_have_bounds() -> None:
    with pytest.raises(DecodeError, match="at most"):
        spoken("a" * (MAX_TEXT_CHARS + 1), "en", 16000)
    for voice in ("", "-w", "en; reboot", "../x", "--path=/tmp", "en\n"):
        with pytest.raises(ConfigError):
            check_voice(voice)
