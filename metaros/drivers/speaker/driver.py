"""A speaker: everything that is to be played goes into one mixer, and from there to PortAudio, 20 ms at a time."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from metaros.drivers.context import DriverContext
from metaros.drivers.sound import Pacer, SoundStream
from metaros.drivers.speaker.clips import check_voice, load, named, spoken
from metaros.drivers.speaker.mixer import Mixer, Sound
from metaros.drivers.speaker.packets import PacketReader
from metaros.errors import ConfigError, DecodeError
from metaros.interfaces.foxglove_msgs.msg import RawAudio
from metaros.interfaces.metaros_msgs.msg import AudioPacket
from metaros.interfaces.std_msgs.msg import String

__all__ = ["make"]

STREAM_DEPTH: Final = 50  # packets: a second
CLIP_DEPTH: Final = 4  # texts and files that wait for being read


class Speaker:
    """One sound output."""

    def __init__(self, context: DriverContext) -> None:
        """ConfigError: no voice, or no folder of sounds."""
        self._context = context
        self._rate, self._channels = int(context["rate"]), int(context["channels"])
        self._voice, self._sounds = check_voice(context["voice"]), str(context["sounds"])
        if self._sounds and not Path(self._sounds).is_dir():
            raise ConfigError(f"speaker: sounds: there is no folder {self._sounds}")
        self._stream: SoundStream | None = None
        self._reported: dict[str, int] = {}
        self._mixer = Mixer(self._rate)
        self._talk, self._audio = PacketReader(self._rate), PacketReader(self._rate)
        context.subscription(AudioPacket, "speaker/talk", self._on_talk, STREAM_DEPTH)
        context.subscription(RawAudio, "speaker/audio", self._on_audio, STREAM_DEPTH)
        context.subscription(AudioPacket, "speaker/audio/opus", self._on_packet, STREAM_DEPTH)
        # Reading a clip takes its time: on a thread of its own it keeps nothing else waiting.
        context.subscription(String, "speaker/say", self._on_say, CLIP_DEPTH, dedicated=True)
        context.subscription(String, "speaker/play", self._on_play, CLIP_DEPTH, dedicated=True)

    def open(self) -> None:
        """Reach the output; nothing of what came while it was away is played."""
        self._stream = SoundStream(self._context, "output", rate=self._rate, channels=self._channels)
        self._mixer.silence()
        self._context.opened(f"{self._stream.name} at {self._rate} Hz", hardware_id=self._stream.name)

    def run(self) -> None:
        """Play until the driver stops: silence where there is nothing, so that sound never waits for a start."""
        context, stream, pacer = self._context, self._stream, Pacer(self._context.clock)
        assert stream is not None
        while not context.stopping:
            sound = self._mixer.take(stream.frames) * float(context["volume"])
            samples = np.clip(np.rint(sound * 32768.0), -32768, 32767).astype("<i2")
            if stream.write(np.repeat(samples, self._channels).tobytes()):
                context.count("underflows")
            context.fact("playing", self._mixer.playing)
            self._report()
            if (ahead_s := pacer.ahead_s(blocked=stream.blocked)) > 0:
                context.wait(ahead_s)

    def close(self) -> None:
        """Let it go."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()

    def _on_talk(self, message: AudioPacket) -> None:
        if not len(message.data):
            self._mixer.talk_ends()
            self._talk.reset()
        elif (sound := self._read(self._talk, message)) is not None:
            self._mixer.talk(sound)

    def _on_packet(self, message: AudioPacket) -> None:
        if (sound := self._read(self._audio, message)) is not None:
            self._mixer.stream(sound)

    def _on_audio(self, message: RawAudio) -> None:
        packet = AudioPacket(codec=message.format, sample_rate=message.sample_rate)
        packet.data, packet.channels = message.data, min(message.number_of_channels, 255)
        self._on_packet(packet)

    def _on_say(self, message: String) -> None:
        self._clip(lambda: spoken(message.data, self._voice, self._rate) if message.data.strip() else None)

    def _on_play(self, message: String) -> None:
        self._clip(lambda: load(named(self._sounds, message.data), self._rate) if message.data else None)

    def _read(self, reader: PacketReader, message: AudioPacket) -> Sound | None:
        try:
            rate, channels = message.sample_rate, message.channels
            return reader.read(message.codec, message.data, rate=rate, channels=channels)
        except DecodeError as error:
            self._refuse("bad_packets", error)
            return None

    def _clip(self, make: Any) -> None:
        try:
            sound = make()
        except DecodeError as error:
            self._refuse("bad_clips", error)
            return
        if sound is None:
            self._mixer.no_clips()
        else:
            self._mixer.clip(sound)

    def _refuse(self, counter: str, error: Exception) -> None:
        if not self._context.status.counters[counter]:
            self._context.log.warn(f"speaker: {error}")
        self._context.fact("last_refused", error)
        self._context.count(counter)

    def _report(self) -> None:
        for name, value in self._mixer.counters.copy().items():
            if (more := value - self._reported.get(name, 0)) > 0:
                self._context.count(name, more)
                self._reported[name] = value


def make(context: DriverContext) -> Speaker:
    """The kind's device."""
    return Speaker(context)
