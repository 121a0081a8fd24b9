"""The microphone driver on ALSA's file device: the file's own samples, stamps, Opus, muting, and a device that goes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import metaros
from metaros.clock import SystemClock
from metaros.convert.audio import audio_to_numpy
from metaros.drivers.opus import OpusDecoder
from metaros.errors import ConfigError
from metaros.interfaces.foxglove_msgs.msg import RawAudio
from metaros.interfaces.metaros_msgs.msg import AudioPacket
from metaros.interfaces.std_msgs.msg import Float32, String
from tests.support.devices.alsa import MIC, Alsa, strongest_hz, tone
from tests.support.devices.drivers import running
from tests.support.waiting import wait_until

RATE = 16000
DEEP = replace(metaros.qos_sensor_data, depth=1000)  # a busy machine's viewer is to miss nothing


@pytest.fixture
def alsa(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Alsa:
    made = Alsa(tmp_path, monkeypatch)
    made.say(tone(440, 60, RATE))
    return made


def stamp_ns(message: RawAudio) -> int:
    return message.timestamp.sec * 10**9 + message.timestamp.nanosec


def test_it_publishes_exactly_what_the_device_gives(alsa: Alsa, context: metaros.Context) -> None:
    said = np.random.default_rng(1).integers(-32768, 32768, 60 * RATE, dtype=np.int16)
    alsa.say(said)
    began_ns = SystemClock().wall_ns()
    with running("microphone", {"device": MIC}, context=context, start=False) as driver:
        received = driver.messages(RawAudio, "audio", DEEP)
        driver.node.start()
        wait_until(lambda: len(received) >= 25)
        assert driver.state() == "working"
    assert (received[0].format, received[0].sample_rate, received[0].number_of_channels) == ("pcm-s16", RATE, 1)
    assert {audio_to_numpy(message).shape for message in received} == {(320, 1)}
    samples = np.concatenate([audio_to_numpy(message)[:, 0] for message in received])
    first = next(at for at in range(0, len(said), 320) if np.array_equal(said[at : at + 320], samples[:320]))
    assert np.array_equal(samples, said[first : first + len(samples)])
    stamps = [stamp_ns(message) for message in received]
    assert began_ns - 10**9 < stamps[0] < stamps[-1] < SystemClock().wall_ns() - 20_000_000


def test_opus_is_the_same_tone(alsa: Alsa, hurried_context: metaros.Context) -> None:
    with running("microphone", {"device": MIC, "output": "both"}, context=hurried_context) as driver:
        packets = driver.messages(AudioPacket, "audio/opus", DEEP)
        raw = driver.messages(RawAudio, "audio")
        wait_until(lambda: len(packets) >= 75 and len(raw) >= 75)
    assert {(packet.codec, packet.sample_rate, packet.channels, packet.samples) for packet in packets} == {
        ("opus", RATE, 1, 320)
    }
    assert max(len(packet.data) for packet in packets) < 200
    decoder = OpusDecoder(1)
    decoded = np.concatenate([decoder.decode(bytes(packet.data)) for packet in packets])
    hz, share = strongest_hz((decoded * 32767).astype(np.int16), decoder.rate)
    assert abs(hz - 440) < 5
    assert share > 0.9


def test_level_gain_and_mute(alsa: Alsa, hurried_context: metaros.Context) -> None:
    with running("microphone", {"device": MIC}, context=hurried_context) as driver:
        levels, received = driver.messages(Float32, "audio/level"), driver.messages(RawAudio, "audio")
        wait_until(lambda: len(levels) > 2)
        assert levels[-1].data == pytest.approx(-9.0, abs=0.3)  # a sine of half the scale
        driver.node.parameters["gain_db"] = -20.0
        wait_until(lambda: levels[-1].data == pytest.approx(-29.0, abs=0.3))
        driver.node.parameters["gain_db"] = 40.0
        wait_until(lambda: levels[-1].data > -1)
        assert np.abs(audio_to_numpy(received[-1]).astype(int)).max() >= 32767
        driver.node.parameters["mute"] = True
        wait_until(lambda: driver.status().message == "muted")
        muted_ns = driver.node.clock.wall_ns()

        def since() -> int:
            return sum(stamp_ns(message) > muted_ns for message in received)

        driver.node.status.counters["bytes_read"] = 0
        wait_until(lambda: driver.node.status.counters["bytes_read"] > 20 * 640)  # it goes on listening
        assert since() <= 1
        driver.node.parameters["mute"] = False
        wait_until(lambda: since() > 5)
        assert driver.state() == "working"


def test_a_device_that_goes_and_comes_back(alsa: Alsa, context: metaros.Context) -> None:
    alsa.remove()
    params = {"device": MIC, "allow_faults": True}
    with running("microphone", params, context=context) as driver:
        received = driver.messages(RawAudio, "audio")
        wait_until(lambda: driver.state() == "waiting")
        assert MIC in driver.status().message
        alsa.restore()
        wait_until(lambda: len(received) > 5 and driver.state() == "working")
        fault = driver.viewer.create_publisher(String, "/r1/microphone/fault", 10)
        wait_until(lambda: fault.publish(String(data="unplug")) or driver.state() == "waiting", every_s=0.02)
        alsa.remove()
        count = len(received)
        fault.publish(String(data="clear"))
        wait_until(lambda: MIC in driver.status().message and driver.state() == "waiting")
        alsa.restore()
        wait_until(lambda: len(received) > count + 5 and driver.state() == "working")


def test_what_cannot_work_is_refused(alsa: Alsa, context: metaros.Context) -> None:
    with (
        pytest.raises(ConfigError, match="output must be one of"),
        running("microphone", {"output": "mp3"}, context=context),
    ):
        pass
