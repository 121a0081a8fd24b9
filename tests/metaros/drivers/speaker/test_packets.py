"""Packets of others: what is absurd is refused, what is sound is read, at any rate."""

from __future__ import annotations

import numpy as np
import pytest

from metaros.drivers.opus import OPUS_RATES, OpusDecoder, OpusEncoder
from metaros.drivers.speaker.packets import MAX_PCM_BYTES, PacketReader
from metaros.errors import ConfigError, DecodeError
from tests.support.devices.alsa import strongest_hz, tone


def int16(floats: np.ndarray) -> np.ndarray:
    return (floats * 32767).astype(np.int16)


@pytest.mark.parametrize("rate", OPUS_RATES)
@pytest.mark.parametrize("channels", [1, 2])
def test_opus_there_and_back(rate: int, channels: int) -> None:
    encoder, reader = OpusEncoder(rate, channels, bitrate=32000), PacketReader(16000)
    said = np.repeat(tone(880, 1.5, rate)[:, None], channels, axis=1)
    frames = rate // 50
    packets = [data for at in range(0, len(said), frames) for data in encoder.encode(said[at : at + frames])]
    received = np.concatenate([reader.read("opus", data, rate=rate, channels=channels) for data in packets])
    hz, share = strongest_hz(int16(received), 16000)
    assert abs(hz - 880) < 5
    assert share > 0.9


def test_pcm_of_two_channels_is_mixed_and_brought_to_the_rate() -> None:
    both = np.stack((tone(880, 1, 24000), np.zeros(24000, np.int16)), axis=1)
    received = PacketReader(48000).read("pcm-s16", both.tobytes(), rate=24000, channels=2)
    assert strongest_hz(int16(received), 48000)[0] == pytest.approx(880, abs=2)
    assert np.abs(received).max() == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize(
    ("coding", "data", "rate", "channels"),
    [
        ("pcm-s16", b"abc", 16000, 1),
        ("pcm-s16", b"", 16000, 1),
        ("pcm-s16", bytes(MAX_PCM_BYTES + 2), 16000, 1),
        ("pcm-s16", bytes(2 * 8001 + 2), 8001, 1),
        ("pcm-s16", bytes(4), 0, 1),
        ("pcm-s16", bytes(4), 2**32 - 1, 1),
        ("pcm-s16", bytes(4), 16000, 0),
        ("pcm-s16", bytes(400), 16000, 200),
        ("opus", bytes(6), 48000, 3),
        ("opus", b"", 48000, 1),
        ("opus", bytes(5000), 48000, 1),
        ("mp3", bytes(4), 48000, 1),
        ("\0" * 1000, bytes(4), 48000, 1),
    ],
)
def test_what_is_absurd_is_refused(coding: str, data: bytes, rate: int, channels: int) -> None:
    with pytest.raises(DecodeError):
        PacketReader(48000).read(coding, data, rate=rate, channels=channels)


def test_a_megabyte_of_noise_as_opus() -> None:
    noise, reader = np.random.default_rng(5), PacketReader(48000)
    refused = 0
    left = 1_000_000
    while left > 0:
        data = noise.bytes(int(noise.integers(1, 4096)))
        left -= len(data)
        try:
            received = reader.read("opus", data, rate=48000, channels=1)
            assert len(received) <= 48000 * 0.12  # the longest packet there is
            assert np.isfinite(received).all()
        except DecodeError:
            refused += 1
    assert refused > 10
    said = OpusEncoder(48000, 1, bitrate=32000).encode(tone(880, 0.02, 48000)[:, None])
    assert len(reader.read("opus", said[0], rate=48000, channels=1)) == 960


def test_an_encoder_says_which_rates_there_are() -> None:
    with pytest.raises(ConfigError, match="Opus has the rates"):
        OpusEncoder(44100, 1, bitrate=32000)
    with pytest.raises(DecodeError):
        OpusDecoder(1).decode(b"")
