"""Results of durable commands, on disk until the gateway has them; and which of those commands were begun.

One small file a command: written empty when it begins, with its result when it ends, removed once the gateway says
that it stored the result. A file that is still empty when the agent starts is of a command that a crash interrupted:
nobody knows how far it came, so that is its result, and it is never run again.
"""

from __future__ import annotations

import asyncio
import logging
import zlib
from collections.abc import Iterator

from google.protobuf.message import DecodeError

from edge_agent.errors import DiskError
from edge_agent.outbox import Disk
from metaros._proto import link_pb2
from metaros.limits import LIMITS

__all__ = ["INTERRUPTED", "StoredResults", "interrupted"]

LOG = logging.getLogger("metaros.agent.commands")
INTERRUPTED = "interrupted"
_FOLDER = "results"
_FILE_BYTES = LIMITS.result_bytes + 64 * 1024
_TEXT_CHARS = 4096


class StoredResults:
    """The event loop owns it; what blocks runs on a thread."""

    def __init__(self, disk: Disk) -> None:
        """Read what is there; raises DiskError."""
        self._disk = disk
        self._results = {result.command_id: result for result in self._read()}

    def __len__(self) -> int:
        return len(self._results)

    def __iter__(self) -> Iterator[link_pb2.CommandResult]:
        return iter(list(self._results.values()))

    def get(self, command_id: bytes) -> link_pb2.CommandResult | None:
        """The result that is kept for a command."""
        return self._results.get(command_id)

    async def begin(self, command_id: bytes) -> None:
        """The command is about to run. Raises DiskError: then it must not."""
        await asyncio.to_thread(self._disk.replace, _name(command_id), b"")

    async def keep(self, result: link_pb2.CommandResult) -> link_pb2.CommandResult:
        """It ended; the result as it is to be sent. Where the disk refuses it lives as long as the process."""
        kept = bounded(result)
        self._results[kept.command_id] = kept
        body = kept.SerializeToString()
        try:
            await asyncio.to_thread(
                self._disk.replace, _name(kept.command_id), zlib.crc32(body).to_bytes(4, "big") + body
            )
        except DiskError as error:
            LOG.warning("cannot keep a command's result: %s; it is forgotten at a restart", error)
        return kept

    async def forget(self, command_id: bytes) -> None:
        """The gateway has it, or the command did not begin after all."""
        self._results.pop(command_id, None)
        try:
            await asyncio.to_thread(self._disk.remove, _name(command_id))
        except DiskError as error:
            LOG.warning("cannot remove a command's result: %s", error)

    def _read(self) -> Iterator[link_pb2.CommandResult]:
        for name in self._disk.names(_FOLDER):
            try:
                command_id = bytes.fromhex(name.rpartition("/")[2])
            except ValueError:
                continue
            size = self._disk.size(name)
            data = self._disk.read(name, 0, size) if 0 < size <= _FILE_BYTES else b""
            yield parsed(data, command_id) or interrupted(command_id)


def parsed(data: bytes, command_id: bytes) -> link_pb2.CommandResult | None:
    """The result in a file; None where it holds none, or was damaged."""
    if len(data) <= 4 or zlib.crc32(data[4:]).to_bytes(4, "big") != data[:4]:
        return None
    try:
        result = link_pb2.CommandResult.FromString(data[4:])
    except DecodeError:
        return None
    return result if result.command_id == command_id else None


def bounded(result: link_pb2.CommandResult) -> link_pb2.CommandResult:
    """The result as it is kept and sent: a payload over the limit is left out, and the message says so."""
    kept = link_pb2.CommandResult()
    kept.CopyFrom(result)
    kept.message, kept.kept = kept.message[:_TEXT_CHARS], True
    if len(kept.payload) > LIMITS.result_bytes:
        kept.message = f"the answer of {len(kept.payload)} bytes is over {LIMITS.result_bytes} and was not kept"
        kept.ClearField("payload")
    return kept


def interrupted(command_id: bytes) -> link_pb2.CommandResult:
    """What is answered for a command of which nobody knows how far it came."""
    text = "the agent ended while the command ran: whether it was carried out is not known; it is not run again"
    return link_pb2.CommandResult(command_id=command_id, code=INTERRUPTED, message=text, kept=True)


def _name(command_id: bytes) -> str:
    return f"{_FOLDER}/{command_id[:64].hex()}"
