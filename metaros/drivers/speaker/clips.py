"""Clips: a text spoken by espeak-ng, and a file of the robot's folder of sounds, as samples."""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import wave
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.drivers.opus import have_opus
from metaros.drivers.speaker.resampler import Resampler
from metaros.errors import ConfigError, DecodeError

__all__ = ["MAX_TEXT_CHARS", "check_voice", "load", "named", "spoken"]

MAX_TEXT_CHARS: Final = 1000
MAX_FILE_BYTES: Final = 64 * 1024 * 1024
MAX_CLIP_S: Final = 600
SPEAK_S: Final = 10.0
PIECE: Final = 65_536  # samples converted at a time
_VOICE: Final = re.compile(r"[a-z]{2,3}([-+][A-Za-z0-9]{1,12}){0,3}")
_WIDTHS: Final = {1: "u1", 2: "<i2", 4: "<i4"}

Sound = npt.NDArray[np.float32]


def check_voice(voice: str) -> str:
    """The voice itself; ConfigError where it is none that espeak-ng's command line may be given."""
    if not _VOICE.fullmatch(voice):
        raise ConfigError(f"voice {voice!r} is no name of a voice, such as en-gb")
    return voice


def spoken(text: str, voice: str, rate: int) -> Sound:
    """The text, spoken. It goes in by standard input: nothing of it is ever an argument.

    Raises:
        DecodeError: it is too long, espeak-ng is not installed, or could not say it.
    """
    if len(text) > MAX_TEXT_CHARS:
        raise DecodeError(f"a text has at most {MAX_TEXT_CHARS} characters, not {len(text)}")
    program = shutil.which("espeak-ng")
    if program is None:
        raise DecodeError("texts need espeak-ng: on Debian `apt install espeak-ng`")
    try:
        done = subprocess.run(
            [program, "-v", voice, "-b", "1", "--stdin", "--stdout"],
            input=text.replace("\0", " ").encode(),
            capture_output=True,
            timeout=SPEAK_S,
            check=True,
        )
    except (subprocess.SubprocessError, OSError) as error:
        raise DecodeError(f"espeak-ng: {error}") from None
    return _wav(done.stdout, rate)


def named(folder: str, name: str) -> Path:
    """The file of that name in the folder of sounds. DecodeError: no folder, no such file, or it is elsewhere."""
    if not folder:
        raise DecodeError("the parameter `sounds` names no folder")
    if (
        not name
        or len(name.encode(errors="replace")) > 255
        or Path(name).name != name
        or name.startswith(".")
        or "\\" in name
        or "\0" in name
    ):
        raise DecodeError(f"{name[:80]!r} is no name of a file in the folder of sounds")
    try:
        root = Path(folder).resolve()
        path = (root / name).resolve()
        there = path.parent == root and path.is_file()
    except (OSError, ValueError):  # what no file system can have
        there = False
    if not there:
        raise DecodeError(f"there is no file {name!r} in the folder of sounds")
    return path


def load(path: Path, rate: int) -> Sound:
    """A file's samples, mixed to one channel. DecodeError: it is too large, or no sound."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise DecodeError(f"{path.name} is larger than {MAX_FILE_BYTES} bytes")
        if path.suffix.lower() in (".wav", ".wave"):
            return _wav(path.read_bytes(), rate)
    except OSError as error:
        raise DecodeError(f"{path.name}: {error.strerror}") from None
    if not have_opus():
        raise DecodeError(f"{path.name}: without PyAV only WAV files are played: pip install 'metaros[video]'")
    return _by_ffmpeg(path, rate)


def _wav(data: bytes, rate: int) -> Sound:
    try:
        with wave.open(io.BytesIO(data)) as file:
            width, channels, its_rate = file.getsampwidth(), file.getnchannels(), file.getframerate()
            if width not in _WIDTHS or not 1 <= channels <= 8 or not 4000 <= its_rate <= 192_000:
                raise DecodeError(f"a WAV file of {8 * width} bits, {channels} channels, {its_rate} Hz is not played")
            raw = file.readframes(MAX_CLIP_S * its_rate)
    except (wave.Error, EOFError) as error:
        raise DecodeError(f"no WAV file: {error}") from None
    samples = np.frombuffer(raw[: len(raw) // (width * channels) * width * channels], _WIDTHS[width])
    scaled = samples.astype(np.float32) / float(1 << (8 * width - 1)) - (1.0 if width == 1 else 0.0)
    return _at_rate(scaled.reshape(-1, channels).mean(axis=1, dtype=np.float32), its_rate, rate)


def _by_ffmpeg(path: Path, rate: int) -> Sound:
    import av

    try:
        with av.open(str(path)) as container:
            convert: Any = av.AudioResampler(format="flt", layout="mono", rate=rate)
            parts: list[Sound] = []
            left = MAX_CLIP_S * rate
            for frame in container.decode(audio=0):
                parts += [made.to_ndarray().reshape(-1) for made in convert.resample(frame)]
                left -= len(parts[-1]) if parts else 0
                if left <= 0:
                    break
    except (av.FFmpegError, IndexError, ValueError) as error:
        raise DecodeError(f"{path.name} is no sound: {error}") from None
    return np.concatenate(parts) if parts else np.zeros(0, np.float32)


def _at_rate(samples: Sound, its_rate: int, rate: int) -> Sound:
    resampler = Resampler(its_rate, rate)
    pieces = [resampler.push(samples[start : start + PIECE]) for start in range(0, len(samples), PIECE)]
    return np.concatenate(pieces) if pieces else samples
