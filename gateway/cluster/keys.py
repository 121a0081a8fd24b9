"""Keys between gateways, derived from the shared master key; each pair of processes has its own.

A key belongs to one sender's process and one receiver's process, both by their boot ids, and to the store. So what was
sealed for another gateway, for an earlier life of this one, or in another store opens nowhere else, and a counter is
enough of a nonce.
"""

from __future__ import annotations

import hmac
from typing import Final, NamedTuple

from gateway.identity.master import MasterKey

__all__ = ["BOOT_BYTES", "MeshKeys", "Process"]

PURPOSE: Final = "cluster"
BOOT_BYTES: Final = 16
PROOF_CHARS: Final = 32
REMEMBERED_S: Final = 600.0  # how long a master key that was replaced still opens what others seal by it


class Process(NamedTuple):
    """One life of a gateway."""

    gateway: str
    boot: bytes


class MeshKeys:
    """Whom to believe, and how to seal for whom; the event loop's."""

    def __init__(self, master: MasterKey, store_id: str) -> None:
        self._master = master
        self._store_id = store_id
        self._now: tuple[bytes, ...] = ()
        self._earlier: dict[bytes, float] = {}  # replaced keys, and until when they open
        self.look(now_s=0.0)

    def look(self, *, now_s: float) -> bool:
        """Read the master key again if its file has changed; whether that gave other keys."""
        before = self.roots
        found = self._master.subkeys(f"{PURPOSE}|{self._store_id}")
        if found != self._now:
            self._earlier |= dict.fromkeys(self._now, now_s + REMEMBERED_S)
            self._now = found
        self._earlier = {key: until for key, until in self._earlier.items() if until > now_s and key not in found}
        return self.roots != before

    @property
    def roots(self) -> tuple[bytes, ...]:
        """The key that seals, then whatever else opens."""
        return (*self._now, *self._earlier)

    def proof(self, process: Process) -> str:
        """What a gateway shows beside its name, so that nobody else passes for one."""
        return self._proofs(process)[0]

    def proves(self, process: Process, proof: str) -> bool:
        """Whether that was made with a key of ours."""
        return any(hmac.compare_digest(proof.encode(), own.encode()) for own in self._proofs(process))

    def between(self, sender: Process, receiver: Process) -> tuple[bytes, ...]:
        """The keys by which one process's messages to another are sealed: the first one seals, any opens."""
        info = b"|".join((b"pair", sender.gateway.encode(), receiver.gateway.encode())) + sender.boot + receiver.boot
        return tuple(_expanded(root, info) for root in self.roots)

    def _proofs(self, process: Process) -> list[str]:
        info = b"proof|" + process.gateway.encode() + b"|" + process.boot
        return [_expanded(root, info).hex()[:PROOF_CHARS] for root in self.roots]


def _expanded(root: bytes, info: bytes) -> bytes:
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.hazmat.primitives.kdf.hkdf import HKDFExpand

    return HKDFExpand(algorithm=SHA256(), length=32, info=info).derive(root)
