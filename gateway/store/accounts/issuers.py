"""The change of issuers in the database: which are there no more, and which certificates are to be renewed at once.

Every function runs inside a transaction of the caller's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from gateway.store.engine import StoreEngine

__all__ = ["HeldCertificate", "drop_authorities", "held_certificates", "renew_before", "set_renew_before"]

_RENEW_BEFORE = "identity_renew_before_ns"


@dataclass(frozen=True, slots=True)
class HeldCertificate:
    """The newest certificate of a robot that has an identity."""

    robot: str
    issued_ns: int
    not_after_ns: int
    pem: str


def drop_authorities(engine: StoreEngine, ids: Sequence[str]) -> None:
    """Forget issuers: what they signed is a stranger's from now on."""
    engine.many("DELETE FROM authorities WHERE authority = ?", [(one,) for one in ids])


def held_certificates(engine: StoreEngine) -> Iterator[HeldCertificate]:
    """The newest certificate of each robot whose identity has not ended, by robot."""
    rows = engine.fetch(
        "SELECT c.robot, c.issued_ns, c.not_after_ns, c.certificate FROM certificates c"
        " JOIN robot_identities i ON i.robot = c.robot WHERE i.revoked_ns = 0 AND c.revoked_ns = 0"
        " AND NOT EXISTS (SELECT 1 FROM certificates n WHERE n.parent = c.serial)"
        " ORDER BY c.robot, c.issued_ns DESC, c.not_after_ns DESC"
    )
    robot = None
    for row in rows:
        if row[0] != robot:
            robot = row[0]
            yield HeldCertificate(*row)


def renew_before(engine: StoreEngine) -> int:
    """Certificates that were issued before this moment are to be renewed at once; 0: none."""
    rows = engine.fetch("SELECT value FROM meta WHERE key = ?", _RENEW_BEFORE)
    return int(rows[0][0]) if rows else 0


def set_renew_before(engine: StoreEngine, at_ns: int) -> None:
    """Every gateway on the database asks for it within seconds."""
    put = "INSERT INTO meta VALUES (?, ?) ON CONFLICT (key) DO UPDATE SET value = excluded.value"
    engine.execute(put, _RENEW_BEFORE, str(at_ns))
