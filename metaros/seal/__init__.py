"""Sealed payloads: encrypted on the robot, opened where the key is; who carries and stores them cannot read them."""

from metaros.seal.envelope import OVERHEAD_BYTES, SEALED_CDR, Head, Origin, parse_head
from metaros.seal.keyring import Keyring, SealKey
from metaros.seal.opener import Opened, Opener, SeenFrames
from metaros.seal.sealer import Sealer

__all__ = [
    "OVERHEAD_BYTES",
    "SEALED_CDR",
    "Head",
    "Keyring",
    "Opened",
    "Opener",
    "Origin",
    "SealKey",
    "Sealer",
    "SeenFrames",
    "parse_head",
]
