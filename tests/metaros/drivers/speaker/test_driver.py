"""The speaker driver on ALSA's file device: what is published is what the file holds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import metaros
from metaros.convert.audio import numpy_to_audio
from metaros.drivers.opus import OpusEncoder
from metaros.errors import ConfigError
from metaros.interfaces.foxglove_msgs.msg import RawAudio
from metaros.interfaces.metaros_msgs.msg import AudioPacket
from metaros.interfaces.std_msgs.msg import String
from tests.metaros.drivers.speaker.test_clips import write_wav
from tests.support.devices.alsa import SPEAKER, Alsa, strongest_hz, tone
from tests.support.devices.drivers import RunningDriver, running
from tests.support.waiting import wait_until

RATE = 16000


@pytest.fixture
def alsa(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Alsa:
    return Alsa(tmp_path, monkeypatch)


@pytest.fixture
def speaker(alsa: Alsa, tmp_path: Path, hurried_context: metaros.Context) -> Iterator[RunningDriver]:
    write_wav(tmp_path / "horn.wav")
    params = {"device": SPEAKER, "rate": RATE, "sounds": str(tmp_path)}
    with running("speaker", params, context=hurried_context) as driver:
        wait_until(lambda: driver.state() == "working")
        yield driver


def publisher(driver: RunningDriver, message_type: type, topic: str) -> metaros.Publisher:
    return driver.viewer.create_publisher(message_type, f"/r1/{topic}", 50)


def loudness(alsa: Alsa, last_s: float = 0.2) -> int:
    """Of what was played last."""
    newest = alsa.played()[-round(last_s * RATE) :]
    return int(np.abs(newest.astype(int)).max()) if len(newest) else 0


def test_the_file_gets_the_samples_of_a_stream(speaker: RunningDriver, alsa: Alsa) -> None:
    said = tone(500, 0.25, RATE)
    said[0] = 1234
    publisher(speaker, RawAudio, "speaker/audio").publish(numpy_to_audio(said, RATE))
    wait_until(lambda: speaker.facts().get("playing") == "nothing" and len(np.flatnonzero(alsa.played() == 1234)) > 0)
    played = alsa.played()
    first = int(np.flatnonzero(played)[0])
    wait_until(lambda: len(alsa.played()) >= first + len(said))
    assert np.array_equal(alsa.played()[first : first + len(said)], said)


def test_opus_at_another_rate_is_the_same_tone(speaker: RunningDriver, alsa: Alsa) -> None:
    talk, encoder = publisher(speaker, AudioPacket, "speaker/talk"), OpusEncoder(48000, 1, bitrate=32000)
    said = tone(880, 60, 48000)
    at = 0

    def enough() -> bool:
        nonlocal at
        received_s = np.count_nonzero(alsa.played()) / RATE
        while at / 48000 < received_s + 0.2:
            for data in encoder.encode(said[at : at + 960, None]):
                talk.publish(AudioPacket(codec="opus", sample_rate=48000, channels=1, samples=960, data=data))
            at += 960
        return received_s > 1.0

    wait_until(enough)
    hz, _share = strongest_hz(alsa.played(), RATE)
    assert abs(hz - 880) < 5
    talk.publish(AudioPacket())  # the end of talk
    wait_until(lambda: loudness(alsa) == 0)


def test_texts_files_and_talk_that_interrupts_them(speaker: RunningDriver, alsa: Alsa) -> None:
    play, say = publisher(speaker, String, "speaker/play"), publisher(speaker, String, "speaker/say")
    play.publish(String(data="horn.wav"))
    wait_until(lambda: strongest_hz(alsa.played(), RATE)[0] == pytest.approx(660, abs=5), every_s=0.05)
    wait_until(lambda: speaker.facts().get("playing") == "nothing")
    say.publish(String(data="one two three four five six seven eight nine ten eleven twelve thirteen fourteen"))
    wait_until(lambda: speaker.facts().get("playing") == "clip")
    talk = publisher(speaker, AudioPacket, "speaker/talk")
    quiet = np.ones(1600, "<i2")
    talk.publish(AudioPacket(codec="pcm-s16", sample_rate=RATE, channels=1, data=quiet.tobytes()))
    wait_until(lambda: int(speaker.facts().get("clips_interrupted", 0)) == 1)
    wait_until(lambda: loudness(alsa) == 0)
    for name in ("../horn.wav", "nothing.wav"):
        play.publish(String(data=name))
    say.publish(String(data="x" * 2000))
    wait_until(lambda: int(speaker.facts().get("bad_clips", 0)) == 3)


def test_volume_is_obeyed_at_once(speaker: RunningDriver, alsa: Alsa) -> None:
    stream = publisher(speaker, RawAudio, "speaker/audio")
    loud = tone(500, 0.1, RATE)

    def plays(most: int) -> bool:
        stream.publish(numpy_to_audio(loud, RATE))
        return 0.8 * most < loudness(alsa) < 1.2 * most

    wait_until(lambda: plays(16384), every_s=0.02)
    speaker.node.parameters["volume"] = 0.25
    wait_until(lambda: plays(4096), every_s=0.02)


def test_garbage_on_every_topic(speaker: RunningDriver, alsa: Alsa) -> None:
    noise = np.random.default_rng(9)
    talk, opus = publisher(speaker, AudioPacket, "speaker/talk"), publisher(speaker, AudioPacket, "speaker/audio/opus")
    raw, say = publisher(speaker, RawAudio, "speaker/audio"), publisher(speaker, String, "speaker/say")
    big = noise.integers(0, 256, 1_000_000, dtype=np.uint8)
    absurd = 0
    for coding in ("opus", "pcm-s16", "", "\0nonsense"):
        for rate, channels in ((0, 0), (2**32 - 1, 255), (16000, 1)):
            for topic in (talk, opus):
                topic.publish(AudioPacket(codec=coding, sample_rate=rate, channels=channels, data=big))
            raw.publish(RawAudio(format=coding, sample_rate=rate, number_of_channels=2**32 - 1, data=big))
            absurd += 3
        wait_until(lambda: int(speaker.facts().get("bad_packets", 0)) >= absurd)  # noqa: B023 - asked at once
    say.publish(String(data="\x1b\0\n" * 10))
    assert speaker.state() == "working"
    said = tone(500, 0.25, RATE)
    raw.publish(numpy_to_audio(said, RATE))
    wait_until(lambda: loudness(alsa) > 16000)


def test_a_device_that_goes_and_comes_back(alsa: Alsa, context: metaros.Context) -> None:
    alsa.remove()
    with running("speaker", {"device": SPEAKER, "rate": RATE}, context=context) as driver:
        wait_until(lambda: driver.state() == "waiting")
        stream = publisher(driver, RawAudio, "speaker/audio")
        stream.publish(numpy_to_audio(np.full(3200, 9999, np.int16), RATE))  # never heard: it is late by then
        alsa.restore()
        wait_until(lambda: driver.state() == "working")
        stream.publish(numpy_to_audio(np.full(3200, 777, np.int16), RATE))
        wait_until(lambda: loudness(alsa) == 777)
        assert 9999 not in alsa.played()


@pytest.mark.parametrize("params", [{"voice": "-w/tmp/x"}, {"sounds": "/nonexistent"}])
def test_what_cannot_work_is_refused(params: dict[str, str], alsa: Alsa, context: metaros.Context) -> None:
    with pytest.raises(ConfigError, match="could not configure"), running("speaker", params, context=context):
        pass
