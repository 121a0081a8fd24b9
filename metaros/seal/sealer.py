"""Seals payloads: a data key for each stream, made new before it has sealed too much or for too long."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from cryptography.hazmat.primitives.ciphers.aead import AESGCM

from metaros.clock import Clock
from metaros.limits import LIMITS, Limits
from metaros.seal.envelope import VERSION, Head, Origin, associated, data_key
from metaros.seal.keyring import Keyring

__all__ = ["Sealer"]

BOOT_BYTES: Final = 16
PREFIX_BYTES: Final = 4
Stream = tuple[str, int]  # robot, stream


@dataclass(slots=True)
class _DataKey:
    """A data key at work; a nonce is `prefix` and how many it has sealed before."""

    key_id: bytes
    boot: bytes
    prefix: bytes
    cipher: AESGCM
    born_s: float
    process: int  # a forked child has a copy of it, which must not go on counting
    count: int = 0


class Sealer:
    """One thread's. `entropy` gives that many random bytes."""

    def __init__(
        self,
        keyring: Keyring,
        clock: Clock,
        *,
        entropy: Callable[[int], bytes] = os.urandom,
        limits: Limits = LIMITS,
    ) -> None:
        self._keyring = keyring
        self._clock = clock
        self._entropy = entropy
        self._limits = limits
        self._keys: OrderedDict[Stream, _DataKey] = OrderedDict()

    def use(self, keyring: Keyring) -> None:
        """Seal by another keyring's current key from now on."""
        self._keyring = keyring

    def seal(self, payload: bytes, origin: Origin, *, stream: int, epoch: int, seq: int) -> bytes:
        """The sealed payload, `OVERHEAD_BYTES` longer."""
        key = self._key(origin.robot, stream)
        nonce = key.prefix + key.count.to_bytes(8, "big")
        key.count += 1  # before it is used: a failure wastes a nonce, and never gives it twice
        head = Head(VERSION, key.key_id, nonce, key.boot, stream, epoch, seq).pack()
        return head + key.cipher.encrypt(nonce, payload, associated(head, origin))

    def _key(self, robot: str, stream: int) -> _DataKey:
        key = self._keys.get((robot, stream))
        if key is None or self._is_spent(key):
            key = self._keys[robot, stream] = self._make(robot, stream)
            while len(self._keys) > self._limits.seal_streams:
                self._keys.popitem(last=False)  # made anew, of fresh chance, when it is wanted again
        return key

    def _is_spent(self, key: _DataKey) -> bool:
        return (
            key.key_id != self._keyring.current.key_id
            or key.process != os.getpid()
            or key.count >= self._limits.seal_frames_per_key
            or self._clock.monotonic_s() - key.born_s >= self._limits.seal_key_s
        )

    def _make(self, robot: str, stream: int) -> _DataKey:
        current, boot = self._keyring.current, self._entropy(BOOT_BYTES)
        made = data_key(current.secret, key_id=current.key_id, boot=boot, robot=robot, stream=stream)
        prefix = self._entropy(PREFIX_BYTES)
        return _DataKey(current.key_id, boot, prefix, AESGCM(made), self._clock.monotonic_s(), os.getpid())
