"""What a sealed payload looks like, which key opens it, and what it is bound to. Pure.

    version 1 | key id 8 | nonce 12 | boot 16 | stream 4 | epoch 8 | seq 8 | ciphertext and tag

Numbers are big-endian. AES-256-GCM; its associated data is the head, then robot, topic and codec, each behind its
length: a payload that is moved to another robot, topic, type or number does not open. The data key is made of the
keyring's secret by HKDF-SHA256 with `boot` as salt: a fresh random one in every process, so that no two programs, not
even two that run from copies of one disk, ever use the same key with the same nonce.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF

from metaros.errors import SealFormatError
from metaros.limits import LIMITS

__all__ = ["HEAD", "OVERHEAD_BYTES", "SEALED_CDR", "VERSION", "Head", "Origin", "associated", "data_key", "parse_head"]

SEALED_CDR: Final = "sealed/cdr"  # the encoding of a channel whose payloads are sealed CDR
VERSION: Final = 1
HEAD: Final = struct.Struct(">B8s12s16sIQQ")
TAG_BYTES: Final = 16
OVERHEAD_BYTES: Final = HEAD.size + TAG_BYTES
_LENGTH: Final = struct.Struct(">I")


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Whose payloads they are, as their reader knows it from the channel."""

    robot: str
    topic: str
    type_name: str
    type_hash: str

    @property
    def codec(self) -> str:
        """What the bytes are once opened."""
        return f"cdr {self.type_name} {self.type_hash}"


class Head(NamedTuple):
    """The part of a sealed payload that anybody can read, and nobody can change."""

    version: int
    key_id: bytes
    nonce: bytes
    boot: bytes
    stream: int
    epoch: int
    seq: int

    def pack(self) -> bytes:
        """Its bytes."""
        return HEAD.pack(*self)


def parse_head(sealed: bytes) -> Head:
    """The head of a sealed payload; SealFormatError when it is too short or of another version."""
    if len(sealed) < OVERHEAD_BYTES:
        raise SealFormatError(f"{len(sealed)} bytes are no sealed payload, the least is {OVERHEAD_BYTES}")
    head = Head._make(HEAD.unpack_from(sealed))
    if head.version != VERSION:
        raise SealFormatError(f"sealed as version {head.version}, this program knows {VERSION}")
    return head


def associated(head: bytes, origin: Origin) -> bytes:
    """The associated data: what the payload is bound to."""
    return head + _bound(origin)


@lru_cache(maxsize=LIMITS.seal_streams)
def _bound(origin: Origin) -> bytes:
    texts = [text.encode() for text in (origin.robot, origin.topic, origin.codec)]
    return b"".join(_LENGTH.pack(len(text)) + text for text in texts)


def data_key(secret: bytes, *, key_id: bytes, boot: bytes, robot: str, stream: int) -> bytes:
    """The 32-byte key of one stream of one process."""
    info = b"metaros seal 1\0" + key_id + _LENGTH.pack(stream) + robot.encode()
    return HKDF(algorithm=SHA256(), length=32, salt=boot, info=info).derive(secret)
