"""Push-to-talk through a robot's speaker: the lease, packets of speech under it, and the empty packet that ends it.

A packet goes on as it came: one Opus packet or a piece of 16-bit PCM, in a `metaros_msgs/msg/AudioPacket`.
"""

from __future__ import annotations

from typing import Final

from gateway.domain.fleet.lease import Lease
from gateway.errors import InvalidRequestError, RobotError
from gateway.fleet.lease_manager import HeldLease, LeaseManager
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.idl import type_hash
from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.metaros_msgs.msg import AudioPacket
from metaros.limits import LIMITS

__all__ = ["CODECS", "SAMPLE_RATES", "TALK_TOPICS", "TalkManager"]

TALK_TOPICS: Final = ("**/speaker/talk",)  # as every agent has them
CODECS: Final = ("opus", "pcm-s16")
SAMPLE_RATES: Final = (8000, 12000, 16000, 24000, 48000)
AUDIO: Final = "metaros_msgs/msg/AudioPacket"


class TalkManager(LeaseManager):
    """Takes, keeps and ends talks; lives on the event loop."""

    topic = "speaker/talk"

    async def say(self, talk: HeldLease, sound: bytes, *, coding: str, sample_rate: int) -> Lease:
        """Send one packet of one channel and renew the lease; one that lapsed unclaimed is taken again.

        Raises:
            InvalidRequestError: no coding, rate or size of CODECS, SAMPLE_RATES and the limits.
            LeaseRequiredError, LeaseTakenError: somebody else has the lease, or the robot lost its link.
        """
        if coding not in CODECS or sample_rate not in SAMPLE_RATES:
            raise InvalidRequestError(f"codec is {' or '.join(CODECS)}, sample_rate one of {SAMPLE_RATES}")
        if not 0 < len(sound) <= LIMITS.talk_packet_bytes or (coding == "pcm-s16" and len(sound) % 2):
            raise InvalidRequestError(f"a packet of speech has 1 to {LIMITS.talk_packet_bytes} bytes, of whole samples")
        lease = await self._renewed(talk)
        self._packet(talk, sound, coding=coding, sample_rate=sample_rate)
        return lease

    def stop(self, drive: HeldLease) -> None:
        """An empty packet: silence at once, if the robot can still be told."""
        if not drive.lost:
            try:
                self._packet(drive, b"", coding="", sample_rate=0)
            except RobotError:
                drive.gone.set()

    def _packet(self, talk: HeldLease, sound: bytes, *, coding: str, sample_rate: int) -> None:
        sec, nanosec = divmod(self._clock.wall_ns(), 1_000_000_000)
        packet = AudioPacket(
            stamp=Time(sec=sec, nanosec=nanosec),
            codec=coding,
            sample_rate=sample_rate,
            channels=1 if sound else 0,
            samples=len(sound) // 2 if coding == "pcm-s16" else 0,
            data=sound,
        )
        self._put(talk, AUDIO, type_hash(AUDIO), codec(AudioPacket).encode(packet))

    def _granting(self, grant: link_pb2.GrantLease) -> link_pb2.Command:
        return link_pb2.Command(grant_talk=grant)

    def _releasing(self, lease_id: str) -> link_pb2.Command:
        return link_pb2.Command(release_talk=link_pb2.ReleaseLease(lease_id=lease_id))

    def _frame(self, teleop: link_pb2.Teleop) -> link_pb2.GatewayFrame:
        return link_pb2.GatewayFrame(talk=teleop)
