"""The agent's watch over talking through the robot's speaker: the drive guard's lease, with bounds on packets. Pure."""

from __future__ import annotations

from edge_agent.commands.drive_watchdog import DriveGuard
from edge_agent.errors import PacketError, TalkOffError
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["TALK_TOPICS", "TalkGuard"]

TALK_TOPICS = ("**/speaker/talk",)
TALK_TYPE = "metaros_msgs/msg/AudioPacket"
HEAD_BYTES = 128  # of an AudioPacket beside its sound
BURST_S = 0.5  # so much more than its rate may come at once after a rest


class TalkGuard(DriveGuard):
    """One talker at a time, beside whoever drives; `on` is the robot's own word. An empty packet ends it."""

    def __init__(self, clock: Clock, *, on: bool = True) -> None:
        super().__init__(clock, TALK_TOPICS, fresh_s=LIMITS.talk_fresh_s)
        self._on = on
        self._left = self._most = LIMITS.talk_packets_per_s * BURST_S
        self._counted_s = clock.monotonic_s()

    def grant(self, lease_id: str, valid_s: float) -> list[str]:
        """As of the drive guard; TalkOffError where nobody may talk here."""
        if not self._on:
            raise TalkOffError("this robot's settings let nobody talk through its speaker")
        return super().grant(lease_id, valid_s)

    def admit(self, type_name: str, payload: bytes) -> None:
        """Raise PacketError for what is no packet of speech, is too large, or comes too often."""
        if type_name != TALK_TYPE:
            raise PacketError(f"speech is {TALK_TYPE}, not {type_name[:80]}")
        if len(payload) > LIMITS.talk_packet_bytes + HEAD_BYTES:
            raise PacketError(f"a packet of speech has at most {LIMITS.talk_packet_bytes} bytes")
        now_s = self._clock.monotonic_s()
        self._left = min(self._most, self._left + (now_s - self._counted_s) * LIMITS.talk_packets_per_s)
        self._counted_s = now_s
        if self._left < 1:
            raise PacketError(f"more than {LIMITS.talk_packets_per_s:g} packets of speech a second")
        self._left -= 1
