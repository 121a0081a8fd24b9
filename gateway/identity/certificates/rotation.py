"""Rotation of the fleet's issuer and root: how each is followed by the next, and when the previous ones retire.

A new issuer under the same root is known to all at once. A new root is not: robots learn it with their next
certificate. Until the old one is retired the new issuer has two certificates, one under either root; everything is
issued and served under the old one, the *bridge*, and both roots are told. Retiring takes the old root and the bridge
away, and the same issuer goes on under the new root.

Every function runs inside a writing transaction of the caller's; keys lie in the data directory.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.x509.oid import NameOID

from gateway.errors import AuthorityError
from gateway.identity.certificates.authorities import PURPOSE, stored_authority
from gateway.identity.certificates.ca import Authority, bridge, key_pem, make_intermediate, make_root, voucher
from gateway.identity.certificates.parsing import issuer_key, load_certificate, pin, subject_key
from gateway.identity.certificates.root_key import ROOT_KEY_NEXT, read_root_key, settle_root_key, write_secret
from gateway.identity.master import MasterKey
from gateway.store.accounts.identities import StoredAuthority, add_authority, list_authorities
from gateway.store.accounts.issuers import HeldCertificate, drop_authorities, held_certificates
from gateway.store.engine import StoreEngine
from metaros.limits import LIMITS

__all__ = ["Issuer", "Retirement", "issuers", "retire", "retirement", "rotate_issuer", "rotate_root", "settle"]

_ISSUER = re.compile(r"Meta-ROS (.+) issuer")


@dataclass(frozen=True, slots=True, kw_only=True)
class Issuer:
    """An issuer, as people see it. `state`: "issues", "follows" (under a new root, still to come) or "accepted"."""

    id: str
    state: str
    root_pin: str
    made_ns: int
    not_after_ns: int
    robots: int  # whose newest certificate is by its key


@dataclass(frozen=True, slots=True)
class Retirement:
    """What goes, what stays, and the robots that would be left without: they have nothing of what stays."""

    drop: tuple[str, ...]
    keep: tuple[str, ...]
    stranded: tuple[str, ...]


def issuers(engine: StoreEngine, *, now_ns: int) -> list[Issuer]:
    """Every issuer that the fleet recognises, the newest first."""
    rows = list_authorities(engine)
    held = [issuer_key(load_certificate(one.pem)) for one in held_certificates(engine) if _renews(one, now_ns)]
    keep = _staying(rows)
    return [
        Issuer(
            id=row.id,
            state="issues" if position == 0 else "follows" if row.id in keep else "accepted",
            root_pin=pin(_root(row)),
            made_ns=row.made_ns,
            not_after_ns=row.not_after_ns,
            robots=held.count(subject_key(_certificate(row))),
        )
        for position, row in enumerate(rows)
    ]


def rotate_issuer(engine: StoreEngine, folder: Path, *, now_ns: int) -> str:
    """A new issuer under the same root; its id.

    Raises:
        AuthorityError: there is none yet, somebody else's issues, a root is being changed, or the root's key is away.
    """
    newest = _newest(list_authorities(engine))
    root = _root(newest)
    settle_root_key(folder, root)
    made = make_intermediate(_fleet(newest), root, read_root_key(folder, root), now_ns=now_ns)
    _add(engine, folder, made, after=newest.id, made_ns=_later(newest, now_ns))
    return made.id


def rotate_root(engine: StoreEngine, folder: Path, *, now_ns: int) -> str:
    """A new root, an issuer under it, and its bridge to the root before; the new root's pin.

    The key of the new root is on the disk before this returns, as `ca-root.key.next`; `settle` is to follow once the
    transaction is committed. AuthorityError as `rotate_issuer`.
    """
    newest = _newest(list_authorities(engine))
    before = _root(newest)
    settle_root_key(folder, before)
    before_key = read_root_key(folder, before)
    root, root_key = make_root(_fleet(newest), now_ns=now_ns)
    made = make_intermediate(_fleet(newest), root, root_key, now_ns=now_ns)
    write_secret(folder / ROOT_KEY_NEXT, key_pem(root_key))
    said, made_ns = voucher(root, before, before_key, now_ns=now_ns), _later(newest, now_ns)
    _add(engine, folder, made, after=newest.id, made_ns=made_ns, vouchers=(said,))
    over = bridge(made, before, before_key, now_ns=now_ns)
    _add(engine, folder, over, after=made.id, made_ns=made_ns + 1)
    return pin(root)


def settle(engine: StoreEngine, folder: Path) -> None:
    """The newest root's key takes its place, and the one before it is deleted; may be called at any time."""
    rows = list_authorities(engine)
    keep = _staying(rows)
    for row in rows:
        if row.id in keep:
            settle_root_key(folder, _root(row))


def retirement(engine: StoreEngine, *, now_ns: int) -> Retirement:
    """What `retire` would do."""
    rows = list_authorities(engine)
    keep = _staying(rows)
    keys = {subject_key(_certificate(row)) for row in rows if row.id in keep}
    stranded = tuple(
        one.robot
        for one in held_certificates(engine)
        if _renews(one, now_ns) and issuer_key(load_certificate(one.pem)) not in keys
    )
    return Retirement(tuple(row.id for row in rows if row.id not in keep), tuple(keep), stranded)


def retire(engine: StoreEngine, *, now_ns: int, force: bool) -> Retirement:
    """Forget every issuer but the newest, and every root but its own.

    Raises:
        AuthorityError: robots would be stranded, and `force` was not said.
    """
    plan = retirement(engine, now_ns=now_ns)
    if plan.stranded and not force:
        some = ", ".join(plan.stranded[:5]) + (", …" if len(plan.stranded) > 5 else "")
        raise AuthorityError(
            f"robots that have no certificate of the newest issuer, and would need a new token: {len(plan.stranded)}"
            f" ({some})\nWait until they have renewed (metaros ca renew asks them to), or say --force."
        )
    drop_authorities(engine, plan.drop)
    return plan


def _renews(one: HeldCertificate, now_ns: int) -> bool:
    """Whether a robot's newest certificate is good for a renewal, still."""
    return now_ns < one.not_after_ns + round(LIMITS.renewal_grace_s * 1e9)


def _staying(rows: Sequence[StoredAuthority]) -> list[str]:
    """The newest issuer; where it is a bridge, the same issuer under its own root."""
    if not rows:
        return []
    newest = rows[0]
    key = subject_key(_certificate(newest))
    twins = [row for row in rows[1:] if subject_key(_certificate(row)) == key and _root(row) != _root(newest)]
    return [twins[0].id if twins else newest.id]


def _newest(rows: Sequence[StoredAuthority]) -> StoredAuthority:
    if not rows:
        raise AuthorityError("the fleet has no authority yet: the first token makes it (metaros robot token)")
    if not rows[0].sealed_key:
        raise AuthorityError("the fleet's issuer was supplied (--ca-cert, --ca-key): supply its successor there")
    if _staying(rows) != [rows[0].id]:
        raise AuthorityError("the root is being changed: first let the old one go, by metaros ca retire")
    return rows[0]


def _add(
    engine: StoreEngine,
    folder: Path,
    made: Authority,
    *,
    after: str,
    made_ns: int,
    vouchers: Sequence[x509.Certificate] = (),
) -> None:
    if made.key is None:
        raise AuthorityError("a new issuer has no key")
    sealed = MasterKey.load_or_make(folder).seal(PURPOSE, made.id, key_pem(made.key))
    if not add_authority(engine, stored_authority(made, sealed, made_ns=made_ns, vouchers=vouchers), newest=after):
        raise AuthorityError("another gateway has made an issuer just now: look at metaros ca list")


def _later(newest: StoredAuthority, now_ns: int) -> int:
    """The order of issuers is that of their making, whatever the clock says."""
    return max(now_ns, newest.made_ns + 1)


def _fleet(row: StoredAuthority) -> str:
    """The fleet's name, for people who read certificates."""
    name = str(_certificate(row).subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value)
    found = _ISSUER.fullmatch(name)
    return found[1] if found is not None else name


def _root(row: StoredAuthority) -> x509.Certificate:
    return x509.load_pem_x509_certificate(row.root.encode())


def _certificate(row: StoredAuthority) -> x509.Certificate:
    return x509.load_pem_x509_certificate(row.certificate.encode())
