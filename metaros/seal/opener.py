"""Opens sealed payloads, and tells those that are not where their robot put them."""

from __future__ import annotations

from collections import OrderedDict
from typing import NamedTuple

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM

from metaros.errors import ReplayError, SealError, SealKeyError
from metaros.limits import LIMITS
from metaros.seal.envelope import HEAD, Head, Origin, associated, data_key, parse_head
from metaros.seal.keyring import Keyring

__all__ = ["Opened", "Opener", "SeenFrames"]

PAGE_SHIFT = 12  # numbers of a page of SeenFrames: 4096, in 512 bytes


class Opened(NamedTuple):
    """A payload, and the head that was bound to it."""

    payload: bytes
    head: Head


class Opener:
    """Keeps the data keys used last; one thread's."""

    def __init__(self, keyring: Keyring, *, streams: int = LIMITS.seal_streams) -> None:
        self._keyring = keyring
        self._streams = streams
        self._ciphers: OrderedDict[tuple[bytes, bytes, str, int], AESGCM] = OrderedDict()

    def open(self, sealed: bytes, origin: Origin, *, seq: int | None = None) -> Opened:
        """The payload; `seq` is the number under which it was found, of which the low 32 bits must agree.

        Raises:
            SealFormatError: it is no sealed payload.
            SealKeyError: the keyring does not hold its key.
            SealError: it was changed, or belongs elsewhere.
        """
        head = parse_head(sealed)
        if seq is not None and (seq ^ head.seq) & 0xFFFFFFFF:
            raise SealError(f"{origin.topic}: sealed as number {head.seq}, found as {seq}")
        body, bound = sealed[HEAD.size :], associated(sealed[: HEAD.size], origin)
        try:
            return Opened(self._cipher(head, origin.robot).decrypt(head.nonce, body, bound), head)
        except InvalidTag:
            raise SealError(
                f"{origin.topic} number {head.seq}: changed on its way, or not of this robot, topic and type"
            ) from None

    def _cipher(self, head: Head, robot: str) -> AESGCM:
        place = (head.key_id, head.boot, robot, head.stream)
        cipher = self._ciphers.get(place)
        if cipher is None:
            key = self._keyring.find(head.key_id)
            if key is None:
                raise SealKeyError(f"sealed by key {head.key_id.hex()}, which this keyring does not hold")
            made = data_key(key.secret, key_id=head.key_id, boot=head.boot, robot=robot, stream=head.stream)
            cipher = self._ciphers[place] = AESGCM(made)
            if len(self._ciphers) > self._streams:
                self._ciphers.popitem(last=False)
        else:
            self._ciphers.move_to_end(place)
        return cipher


class SeenFrames:
    """Which payloads were opened: a bit each, in pages. Only what opened is noted, so that a forger cannot fill it.

    They are told apart by nonce, not by number: a robot may seal one sample twice, and never two with one nonce.
    """

    def __init__(self) -> None:
        self._pages: dict[tuple[bytes, int, int], bytearray] = {}

    def note(self, head: Head, origin: Origin) -> None:
        """A payload was opened; ReplayError when it was before."""
        count = int.from_bytes(head.nonce[4:], "big")
        place = (head.boot, head.stream, count >> PAGE_SHIFT)
        page = self._pages.setdefault(place, bytearray(1 << PAGE_SHIFT >> 3))
        byte, bit = divmod(count & (1 << PAGE_SHIFT) - 1, 8)
        if page[byte] >> bit & 1:
            raise ReplayError(f"{origin.topic} number {head.seq} came before: it is repeated")
        page[byte] |= 1 << bit
