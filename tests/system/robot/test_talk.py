"""Push to talk through the real programs: what goes into the gateway's socket is what the robot's speaker plays."""

from __future__ import annotations

import json
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from websockets.sync.client import ClientConnection

from metaros.drivers.opus import OpusEncoder
from tests.support.devices.alsa import SPEAKER, Alsa, strongest_hz, tone
from tests.support.gateways.viewer import open_socket
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

RATE, FRAMES, HZ = 48000, 960, 880.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("talk")


@pytest.fixture(scope="module")
def alsa(folder: Path) -> Iterator[Alsa]:
    with pytest.MonkeyPatch.context() as monkeypatch:
        yield Alsa(folder, monkeypatch)


@pytest.fixture(scope="module")
def stack(folder: Path, alsa: Alsa) -> Iterator[Stack]:
    """A gateway, a robot r1 with an agent and the speaker's driver on its router."""
    with Stack(folder) as stack:
        stack.router()
        speaker = ("--param", f"device={SPEAKER}", "--param", f"rate={RATE}", "--zenoh-port", str(stack.zenoh_port))
        stack.start("speaker", "driver", "run", "speaker", "--namespace", "/r1", *speaker, ready=False)
        stack.at_once(stack.gateway, lambda: stack.agent("r1"))
        wait_until(lambda: "r1" in stack.online() and len(alsa.played()) > 0)
        yield stack


class Talker:
    """A client of the talk socket."""

    def __init__(self, socket: ClientConnection, codec: str) -> None:
        self.socket, self.codec = socket, codec
        self.said, self.at = tone(HZ, 60, RATE), 0
        self.encoder = OpusEncoder(RATE, 1, bitrate=32000)

    def take(self, holder: str) -> dict[str, object]:
        self.socket.send(json.dumps({"op": "take", "holder": holder, "codec": self.codec, "sample_rate": RATE}))
        return dict(json.loads(self.socket.recv(timeout=60)))

    def hold(self, holder: str) -> dict[str, object]:
        """Take the lease, once who had it before has gone."""
        answers: list[dict[str, object]] = []
        wait_until(lambda: answers.append(self.take(holder)) or answers[-1]["op"] == "granted")
        return answers[-1]

    def say(self, seconds: float) -> None:
        """At the pace of speech, as a microphone gives it."""
        began_s, packets = time.monotonic(), round(seconds * RATE / FRAMES)
        pause = threading.Event()
        for number in range(packets):
            piece = self.said[self.at : self.at + FRAMES]
            self.at += FRAMES
            sounds = [piece.tobytes()] if self.codec == "pcm-s16" else self.encoder.encode(piece[:, None])
            for sound in sounds:
                self.socket.send(sound)
            pause.wait(max(0.0, began_s + number * FRAMES / RATE - time.monotonic()))


@contextmanager
def talker(stack: Stack, codec: str, *, robot: str = "r1") -> Iterator[Talker]:
    with open_socket(stack.url, f"/api/v1/robots/{robot}/talk", key=stack.key) as socket:
        yield Talker(socket, codec)


def silent(alsa: Alsa, last_s: float = 0.3) -> bool:
    return not alsa.played()[-round(last_s * RATE) :].any()


@pytest.mark.parametrize("codec", ["opus", "pcm-s16"])
def test_what_is_said_is_received(stack: Stack, alsa: Alsa, codec: str) -> None:
    before = len(alsa.played())
    with talker(stack, codec) as ann:
        granted = ann.hold("ann")
        assert (granted["op"], granted["topic"]) == ("granted", "/r1/speaker/talk")
        wait_until(lambda: ann.say(0.5) or strongest_hz(alsa.played()[before:], RATE)[0])
        ann.say(1.0)
        hz, _share = strongest_hz(alsa.played()[before:], RATE)
        print(f"{codec}: said {HZ} Hz, heard {hz:.2f} Hz")
        assert abs(hz - HZ) < 5
        ann.socket.send(json.dumps({"op": "stop"}))
        wait_until(lambda: silent(alsa))


def test_one_talks_at_a_time_and_no_lease_is_silence(stack: Stack, alsa: Alsa) -> None:
    with ExitStack() as opened:
        ann = opened.enter_context(talker(stack, "opus"))
        bob = opened.enter_context(talker(stack, "opus"))
        wait_until(lambda: silent(alsa))
        bob.say(0.2)  # without the lease
        ann.hold("ann")
        refused = bob.take("bob")
        assert (refused["op"], refused["code"], refused["holder"]) == ("refused", "lease_taken", "ann")
        bob.say(0.5)
        assert silent(alsa)
        wait_until(lambda: ann.say(0.2) or not silent(alsa))
        ann.socket.close()  # in the middle of a word
        wait_until(lambda: silent(alsa))
        bob.hold("bob")
        wait_until(lambda: bob.say(0.2) or not silent(alsa))


@pytest.mark.parametrize("victim", ["gateway", "agent-r1"])
def test_killed_in_the_middle_of_a_word_is_silence(stack: Stack, alsa: Alsa, victim: str) -> None:
    with talker(stack, "pcm-s16") as ann:
        ann.hold("ann")
        wait_until(lambda: ann.say(0.2) or not silent(alsa))
        program = next(program for program in stack.programs if program.name == victim)
        program.kill()
        wait_until(lambda: silent(alsa))
    stack.restart(program)
    wait_until(lambda: "r1" in stack.online())


def test_by_no_other_endpoint(stack: Stack, alsa: Alsa) -> None:
    wait_until(lambda: silent(alsa))
    before = len(alsa.played())
    message = {"codec": "pcm-s16", "sample_rate": RATE, "channels": 1, "data": [16] * 4000}
    body = {"topic": "/r1/speaker/talk", "type": "metaros_msgs/msg/AudioPacket", "message": message}
    request = urllib.request.Request(
        f"{stack.url}/api/v1/robots/r1/publish",
        json.dumps(body).encode(),
        {"content-type": "application/json", "authorization": f"Bearer {stack.key}"},
    )
    with pytest.raises(urllib.error.HTTPError) as caught:
        urllib.request.urlopen(request, timeout=60)
    assert (caught.value.code, json.load(caught.value)["code"]) == (409, "lease_required")
    wait_until(lambda: len(alsa.played()) > before)
    assert not np.any(alsa.played()[before:])


def test_a_robot_that_lets_nobody_talk(stack: Stack, tmp_path: Path) -> None:
    settings = tmp_path / "agent.toml"
    settings.write_text("talk = false\n")
    stack.agent("r2", "--config", str(settings))
    wait_until(lambda: "r2" in stack.online())
    with talker(stack, "opus", robot="r2") as ann:
        refused = ann.take("ann")
        assert (refused["op"], refused["code"]) == ("refused", "talk_off")
