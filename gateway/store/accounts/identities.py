"""Robots' identities and the authorities behind them in the database; inside a transaction of the caller's."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.domain.identity import IdentityState, IssuedCertificate, RobotIdentity
from gateway.store.engine import StoreEngine, placeholders, slices

__all__ = [
    "StoredAuthority",
    "add_authority",
    "changed_identities",
    "list_authorities",
    "list_identities",
    "next_revision",
    "raise_alarm",
    "revoke_identity",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredAuthority:
    """An issuer and its root in PEM; `sealed_key` is empty where the key is not kept here."""

    id: str
    root: str
    certificate: str
    sealed_key: bytes
    made_ns: int
    not_after_ns: int


def next_revision(engine: StoreEngine) -> int:
    """The number of this transaction's change; the row's lock makes others wait for their turn until it is over."""
    engine.execute("UPDATE identity_changes SET revision = revision + 1 WHERE id = 1")
    return int(engine.fetch("SELECT revision FROM identity_changes WHERE id = 1")[0][0])


def changed_identities(engine: StoreEngine, revision: int) -> tuple[int, list[IdentityState]]:
    """What changed since that revision, and the newest one."""
    columns = "robot, revoked_ns, reason, revision, enrolled_ns"
    sql = f"SELECT {columns} FROM robot_identities WHERE revision > ? ORDER BY revision"
    rows = engine.fetch(sql, revision)
    serials: dict[str, set[str]] = {row[0]: set() for row in rows}
    for robots in slices(list(serials)):
        sql = f"SELECT robot, serial FROM certificates WHERE revoked_ns > 0 AND robot IN ({placeholders(len(robots))})"
        for robot, serial in engine.fetch(sql, *robots):
            serials[robot].add(serial)
    states = [IdentityState(row[0], row[1], row[2], frozenset(serials[row[0]]), row[4]) for row in rows]
    return max([revision, *(row[3] for row in rows)]), states


def revoke_identity(engine: StoreEngine, robot: str, reason: str, *, now_ns: int) -> bool:
    """End a robot's identity and every certificate of it; False when it has none that is not ended."""
    revision = next_revision(engine)
    changed = engine.execute(
        "UPDATE robot_identities SET revoked_ns = ?, reason = ?, revision = ? WHERE robot = ? AND revoked_ns = 0",
        now_ns,
        reason,
        revision,
        robot,
    )
    if changed:
        engine.execute("UPDATE certificates SET revoked_ns = ? WHERE robot = ? AND revoked_ns = 0", now_ns, robot)
    return bool(changed)


def raise_alarm(engine: StoreEngine, robot: str, alarm: str, *, now_ns: int) -> None:
    """Remember what looks like a copy of the robot; nothing where it has no identity."""
    engine.execute("UPDATE robot_identities SET alarm = ?, alarm_ns = ? WHERE robot = ?", alarm, now_ns, robot)


def list_identities(engine: StoreEngine, *, limit: int) -> list[RobotIdentity]:
    """Every identity by robot, with its certificates, the newest first."""
    sql = "SELECT robot, enrolled_ns, revoked_ns, reason, alarm, alarm_ns FROM robot_identities ORDER BY robot LIMIT ?"
    rows = engine.fetch(sql, limit)
    certificates: dict[str, list[IssuedCertificate]] = {row[0]: [] for row in rows}
    for robots in slices(list(certificates)):
        sql = (
            "SELECT DISTINCT robot, serial, how, issued_ns, not_after_ns, revoked_ns FROM certificates"
            f" WHERE robot IN ({placeholders(len(robots))}) ORDER BY issued_ns DESC, not_after_ns DESC, serial"
        )
        for robot, serial, how, issued_ns, not_after_ns, revoked_ns in engine.fetch(sql, *robots):
            one = IssuedCertificate(
                serial=serial, how=how, issued_ns=issued_ns, not_after_ns=not_after_ns, revoked_ns=revoked_ns
            )
            certificates[robot].append(one)
    return [
        RobotIdentity(
            robot=row[0],
            enrolled_ns=row[1],
            revoked_ns=row[2],
            reason=row[3],
            alarm=row[4],
            alarm_ns=row[5],
            certificates=tuple(certificates[row[0]]),
        )
        for row in rows
    ]


def list_authorities(engine: StoreEngine) -> list[StoredAuthority]:
    """Every issuer that this fleet ever had, the newest first."""
    sql = (
        "SELECT authority, root, certificate, sealed_key, made_ns, not_after_ns FROM authorities"
        " ORDER BY made_ns DESC, authority"
    )
    return [
        StoredAuthority(
            id=row[0], root=row[1], certificate=row[2], sealed_key=bytes(row[3]), made_ns=row[4], not_after_ns=row[5]
        )
        for row in engine.fetch(sql)
    ]


def add_authority(engine: StoreEngine, authority: StoredAuthority, *, newest: str) -> bool:
    """Store an issuer if the newest one is still `newest` ("" for none): of two gateways that start, one makes it."""
    next_revision(engine)  # under its lock nobody else adds one
    known = list_authorities(engine)
    if (known[0].id if known else "") != newest:
        return False
    engine.execute(
        "INSERT INTO authorities VALUES (?, ?, ?, ?, ?, ?)",
        authority.id,
        authority.root,
        authority.certificate,
        authority.sealed_key,
        authority.made_ns,
        authority.not_after_ns,
    )
    return True
