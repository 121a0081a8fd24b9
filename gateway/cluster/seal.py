"""Seals messages between gateways: AES-256-GCM under the key of the two processes, numbered without gaps.

A sealed frame is version (1 byte), the sender's boot id (16), its number (8), ciphertext and tag. The number is the
nonce, and the head is authenticated. One that was sent before, or comes after a later one, is refused; where numbers
are missing the receiver is told so.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Final

from gateway.cluster.keys import BOOT_BYTES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cryptography.hazmat.primitives.ciphers.aead import AESGCM

__all__ = ["HEAD_BYTES", "TAG_BYTES", "ForgedError", "Opener", "Sealer", "sender_of"]

VERSION: Final = 1
TAG_BYTES: Final = 16
_HEAD: Final = struct.Struct(f">B{BOOT_BYTES}sQ")
HEAD_BYTES: Final = _HEAD.size


class ForgedError(Exception):
    """What came is not what a gateway of this store sent to this one, or it came before."""


class Sealer:
    """Of one sending process for one receiving process; one thread's, but for `use`."""

    def __init__(self, boot: bytes, keys: Sequence[bytes]) -> None:
        self._boot = boot
        self._number = 0
        self.use(keys)

    def use(self, keys: Sequence[bytes]) -> None:
        """Seal by the first of these from now on."""
        self._cipher = _cipher(keys[0])

    def seal(self, plain: bytes) -> bytes:
        """The next frame."""
        self._number += 1
        head = _HEAD.pack(VERSION, self._boot, self._number)
        return head + self._cipher.encrypt(_nonce(self._number), plain, head)


class Opener:
    """The other end of it; one thread's, but for `use`."""

    def __init__(self, keys: Sequence[bytes]) -> None:
        self._last = 0
        self.use(keys)

    def use(self, keys: Sequence[bytes]) -> None:
        """Open what any of these has sealed."""
        self._ciphers = [_cipher(key) for key in keys]

    def open(self, frame: bytes) -> tuple[bytes, bool]:
        """What was sealed, and whether something before it is missing.

        Raises:
            ForgedError: no process that has the key sealed this for this one, or it has come before.
        """
        head = frame[:HEAD_BYTES]
        _, _, number = _HEAD.unpack(head)
        if number <= self._last:
            raise ForgedError("it came before")
        plain = self._opened(head, frame[HEAD_BYTES:], _nonce(number))
        missing, self._last = number != self._last + 1, number
        return plain, missing

    def _opened(self, head: bytes, sealed: bytes, nonce: bytes) -> bytes:
        from cryptography.exceptions import InvalidTag

        for cipher in self._ciphers:
            try:
                return cipher.decrypt(nonce, sealed, head)
            except InvalidTag:
                continue
        raise ForgedError("no key of this store sealed it for this gateway")


def sender_of(frame: bytes) -> bytes:
    """The boot id that a frame claims; ForgedError for what is no frame."""
    if len(frame) < HEAD_BYTES + TAG_BYTES or frame[0] != VERSION:
        raise ForgedError("it is no frame")
    return frame[1 : 1 + BOOT_BYTES]


def _nonce(number: int) -> bytes:
    return number.to_bytes(12, "big")


def _cipher(key: bytes) -> AESGCM:
    from cryptography.hazmat.primitives.ciphers.aead import AESGCM

    return AESGCM(key)
