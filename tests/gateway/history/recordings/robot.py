"""A scripted robot that has recordings: it offers files and sends what the gateway wants of them."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from typing import Any

from metaros._proto import link_pb2
from metaros.limits import LIMITS
from tests.gateway.harness import BACKFILL, CONTROL, ScriptedAgent

PART = LIMITS.recording_part_bytes


def content(size_bytes: int, *, salt: int = 0) -> bytes:
    """Bytes of which no two pieces are alike."""
    digest = hashlib.shake_128(salt.to_bytes(4, "little"))
    return digest.digest(size_bytes)


@lru_cache
def digest(blob: bytes) -> bytes:
    """Of a whole file, once."""
    return hashlib.sha256(blob).digest()


class RecordingRobot(ScriptedAgent):
    """What the agent's half does, one step at a time."""

    async def asked(self) -> link_pb2.Command:
        """The next SaveRecording."""
        while True:
            command = (await self.next("command", CONTROL)).command
            if command.WhichOneof("action") == "save_recording":
                return command

    async def offer(self, recording_id: str, blob: bytes, **more: Any) -> None:
        """Say that there is a file."""
        facts: dict[str, Any] = {"from_ns": 5 * 10**9, "to_ns": 65 * 10**9, "messages": 42, **more}
        await self._say(recording_id, blob, 0, b"", **facts)

    async def part(self, recording_id: str, blob: bytes, offset: int, size_bytes: int = PART) -> None:
        """Send one piece."""
        await self._say(recording_id, blob, offset, blob[offset : offset + size_bytes])

    async def wanted(self) -> link_pb2.RecordingWanted:
        """What the gateway says next about a recording."""
        return (await self.next("recording_wanted", BACKFILL)).recording_wanted

    async def deliver(self, recording_id: str, blob: bytes, *, part_bytes: int = PART) -> link_pb2.RecordingWanted:
        """Send all of an offered file as an agent does; the gateway's last word."""
        sent, reported = 0, -1
        while True:
            wanted = await self.wanted()
            if wanted.recording_id != recording_id:
                continue
            if wanted.stored or wanted.unwanted:
                return wanted
            if wanted.offset <= reported or reported < 0:
                sent = wanted.offset
            reported = wanted.offset
            while sent < len(blob) and sent < reported + LIMITS.recording_window_bytes:
                await self.part(recording_id, blob, sent, part_bytes)
                sent = min(len(blob), sent + part_bytes)

    async def _say(self, recording_id: str, blob: bytes, offset: int, data: bytes, **more: Any) -> None:
        facts = {"size_bytes": len(blob), "sha256": digest(blob), **more}
        part = link_pb2.RecordingPart(recording_id=recording_id, offset=offset, data=data, **facts)
        await self.send(BACKFILL, recording=part)
