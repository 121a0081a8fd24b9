"""Seals what the topic table says is sealed: where a sample gets its number, before it is on any disk or link.

Durable samples are sealed as the outbox numbers them, live ones as the live queue does, recorded ones as the black box
writes them, under the publisher's own numbers. The keyring's file is looked at once a second, so that a new key seals
without a restart; a file that cannot be read leaves the old keys in use.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

from metaros.clock import Clock
from metaros.errors import ConfigError, KeyringError
from metaros.link import CHANNEL_MASK
from metaros.seal import Keyring, Origin, Sealer

if TYPE_CHECKING:
    from edge_agent.config.settings import Settings
    from edge_agent.forwarding.channels import Channel
    from edge_agent.outbox.pending import Seal

__all__ = ["BLACK_BOX_STREAM", "KEYRING_NAME", "Sealing", "open_sealing"]

LOG = logging.getLogger("metaros.agent.sealing")
KEYRING_NAME: Final = "seal.keys"
BLACK_BOX_STREAM: Final = 0  # the number of the metric stream, which is never sealed
LOOK_S: Final = 1.0


class Sealing:
    """One thread's; `path` is the keyring. Raises KeyringError where it cannot be read at first."""

    def __init__(self, path: Path, robot: str, clock: Clock) -> None:
        self._path = path
        self._robot = robot
        self._clock = clock
        self.refused = 0  # samples of channels that nobody knows: kept nowhere, as they cannot be sealed
        self._origins: dict[int, Origin] = {}  # a channel's number means one thing for ever
        self._mark = mark_of(path)
        self._sealer = Sealer(Keyring.load(path), clock)
        self._look_s = clock.monotonic_s() + LOOK_S

    def accepted(self, channel_of: Callable[[int], Channel | None]) -> Seal:
        """For the outbox: what is kept of a payload of (stream, epoch, seq); None where nothing may be kept.

        Whether a channel that is not known is to be sealed nobody can say, so its samples are never kept in clear.
        """

        def keep(stream: int, epoch: int, seq: int, payload: bytes) -> bytes | None:
            channel = channel_of(stream & CHANNEL_MASK)
            if channel is None:
                self._refuse(stream)
                return None
            if not channel.sealed:
                return payload
            return self._seal(channel, payload, stream, epoch, seq)

        return keep

    def live(self, epoch: Callable[[], int]) -> Callable[[Channel, int, bytes], bytes]:
        """For the live queue: what is sent of a channel's payload and its number, in the epoch that there is then."""

        def send(channel: Channel, seq: int, payload: bytes) -> bytes:
            return self._seal(channel, payload, channel.channel_id, epoch(), seq) if channel.sealed else payload

        return send

    def recorded(self, channel: Channel, gid: bytes, sequence: int, payload: bytes) -> bytes:
        """For the black box: what is kept of a publisher's payload; its epoch stands for the publisher."""
        if not channel.sealed:
            return payload
        publisher = int.from_bytes(hashlib.sha256(gid).digest()[:8], "big")
        return self._seal(channel, payload, BLACK_BOX_STREAM, publisher, sequence & (1 << 64) - 1)

    def _refuse(self, stream: int) -> None:
        if not self.refused:  # once: the count, and the gaps that the outbox declares, say the rest
            LOG.error("samples of stream %d are dropped: its channel is not known, so neither is its seal", stream)
        self.refused += 1

    def _seal(self, channel: Channel, payload: bytes, stream: int, epoch: int, seq: int) -> bytes:
        now_s = self._clock.monotonic_s()
        if now_s >= self._look_s:
            self._look_s = now_s + LOOK_S
            self._look()
        origin = self._origins.get(channel.channel_id)
        if origin is None:
            names = {"topic": channel.topic, "type_name": channel.type_name, "type_hash": channel.type_hash}
            origin = self._origins[channel.channel_id] = Origin(robot=self._robot, **names)
        return self._sealer.seal(payload, origin, stream=stream, epoch=epoch, seq=seq)

    def _look(self) -> None:
        """Take over the file's keys where it has changed."""
        mark = mark_of(self._path)
        if mark == self._mark:
            return
        self._mark = mark
        try:
            keyring = Keyring.load(self._path)
        except KeyringError as error:
            LOG.warning("%s; the keys read before stay in use", error)
            return
        self._sealer.use(keyring)
        LOG.info("sealing with key %s from now on", keyring.current.key_id.hex())


def open_sealing(settings: Settings, directory: Path, clock: Clock) -> Sealing | None:
    """What seals, where a row of the topic table says that something is sealed; else None.

    Raises:
        ConfigError: something is to be sealed, and there is no usable keyring: nothing then leaves the robot.
    """
    if not any(rule.sealed for rule in settings.topics):
        return None
    path = settings.seal_keyring or directory / KEYRING_NAME
    try:
        return Sealing(path, settings.name, clock)
    except KeyringError as error:
        raise ConfigError(f"topics are to be sealed: {error}") from error


def mark_of(path: Path) -> tuple[int, int, int]:
    """What changes when the file does; zeros where there is none."""
    try:
        facts = path.stat()
    except OSError:
        return (0, 0, 0)
    return (facts.st_mtime_ns, facts.st_ino, facts.st_size)
