"""The authority of this gateway: made at first need, its key sealed in the store, or supplied as files.

All gateways on one database share it. One that has another master key recognises every robot, but issues nothing: it
cannot open the key, and says which file to copy.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import serialization

from gateway.errors import AuthorityError, DamagedError
from gateway.identity.certificates.ca import Authority, PrivateKey, key_pem, make_intermediate, make_root, pem, supplied
from gateway.identity.certificates.parsing import issued_by, subject_key
from gateway.identity.certificates.root_key import ROOT_KEY, has_root_key, read_root_key, write_secret
from gateway.identity.master import MasterKey, key_file
from gateway.store import Store
from gateway.store.accounts.identities import StoredAuthority, add_authority, list_authorities
from gateway.store.accounts.issuers import renew_before
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.errors import ConfigError

__all__ = ["PURPOSE", "ROOT_KEY", "Authorities", "stored_authority"]

log = logging.getLogger(__name__)

PURPOSE = "ca"  # under which the keys of issuers are sealed
RENEW_NS = 365 * 86_400_000_000_000  # an issuer with less than this left gets a successor
Held = tuple[Authority, bytes]  # an authority without its key, and the sealed key


class Authorities:
    """Every issuer of the fleet, the newest first."""

    def __init__(
        self,
        store: Store,
        data_dir: Path,
        *,
        fleet: str,
        clock: Clock,
        ca_cert: Path | None = None,
        ca_key: Path | None = None,
        master_key: Path | None = None,
    ) -> None:
        """`ca_cert` and `ca_key` name an issuer made elsewhere; ConfigError when it cannot issue."""
        self.fleet = fleet
        self._store = store
        self._data_dir = data_dir
        self._master_key = master_key or key_file(data_dir)
        self._clock = clock
        self._held: list[Held] = []
        self._opened: dict[str, Authority] = {}  # by their ids: with the key
        self._vouchers: list[x509.Certificate] = []
        self._issuer_keys: frozenset[str] = frozenset()
        self.renew_before_ns = 0  # robots' certificates that were issued before are to be renewed at once
        self._supplied: Authority | None = None
        if (ca_cert is None) != (ca_key is None):
            raise ConfigError("--ca-cert and --ca-key go together")
        if ca_cert is not None and ca_key is not None:
            try:
                self._supplied = supplied(ca_cert.read_bytes(), ca_key.read_bytes(), now_ns=clock.wall_ns())
            except OSError as error:
                raise ConfigError(f"--ca-cert and --ca-key: {error}") from error

    @property
    def issuers(self) -> Sequence[x509.Certificate]:
        """Whoever may have issued a robot's certificate."""
        return [authority.certificate for authority, _ in self._held]

    @property
    def roots_pem(self) -> str:
        """The roots, each once, in PEM; "" while there is none."""
        return pem(*dict.fromkeys(authority.root for authority, _ in self._held))

    @property
    def pins(self) -> set[str]:
        """What good tokens may say of the root."""
        return {authority.pin for authority, _ in self._held}

    @property
    def vouchers_pem(self) -> str:
        """What the roots before say of those that follow them, in PEM; "" when none has followed another."""
        return pem(*self._vouchers)

    @property
    def current_id(self) -> str:
        """The issuer that issues here now; "" before there is one."""
        if self._supplied is not None:
            return self._supplied.id
        return self._held[0][0].id if self._held else ""

    @property
    def opened(self) -> Sequence[Authority]:
        """Who issues here, and who did until another followed and is accepted still; with their keys."""
        return [*self._opened.values(), *([] if self._supplied is None else [self._supplied])]

    def recognises(self, issuer_key: str) -> bool:
        """Whether an issuer with that key is one of the fleet's, still."""
        return issuer_key in self._issuer_keys

    def chain_for(self, leaf: x509.Certificate) -> str:
        """What goes with a certificate: the chain of whoever issued it, which need not be who issues now."""
        for authority, _ in self._held:
            if issued_by(leaf, authority.certificate):
                return authority.chain_pem
        return ""

    async def follow(self) -> bool:
        """Read again what `metaros ca`, or another gateway, may have changed; whether another issuer issues now."""
        before = self.current_id
        await self._read()
        return bool(before) and self.current_id != before

    async def load(self) -> None:
        """Read what the store knows; a supplied issuer is made known to all first."""
        await self._read()
        if self._supplied is not None and self._supplied.id not in {one.id for one, _ in self._held}:
            await self._add(self._supplied, b"")

    async def issuing(self) -> Authority:
        """The issuer with its key; made now when the fleet has none.

        Raises:
            AuthorityError: its key cannot be had here.
        """
        if self._supplied is not None:
            self._check_ended(self._supplied)
            return self._supplied
        if not self._held:
            await self._read()
        if not self._held or self._ends_soon():
            await self._make()
        newest = self._held[0][0]
        if newest.id not in self._opened:
            await self._read()  # it may have been sealed again, by another master key
            newest, sealed = self._held[0]
            key = self._open(newest, sealed)
            self._opened[newest.id] = Authority(newest.root, newest.certificate, key)
        self._check_ended(newest)
        return self._opened[newest.id]

    def _check_ended(self, authority: Authority) -> None:
        if authority.not_after_ns <= self._clock.wall_ns():
            raise AuthorityError(
                f"the issuer of the fleet's certificates ended at {authority.certificate.not_valid_after_utc}: put"
                f" {ROOT_KEY} back into {self._data_dir}, and its successor is made"
            )

    def _ends_soon(self) -> bool:
        """Whether the newest issuer should be followed by another, and the root's key is here to make it."""
        newest, sealed = self._held[0]
        left_ns = newest.not_after_ns - self._clock.wall_ns()
        return bool(sealed) and left_ns < RENEW_NS and has_root_key(self._data_dir, newest.root)

    async def _make(self) -> None:
        """A first issuer with its root, or the next one under the root that there is."""
        now_ns = self._clock.wall_ns()
        if self._held:
            root = self._held[0][0].root
            root_key = read_root_key(self._data_dir, root)
        else:
            root, root_key = make_root(self.fleet, now_ns=now_ns)
        made = make_intermediate(self.fleet, root, root_key, now_ns=now_ns)
        if made.key is None:
            raise AuthorityError("a new issuer has no key")
        sealed = self._master().seal(PURPOSE, made.id, key_pem(made.key))
        path, first = self._data_dir / ROOT_KEY, not self._held
        if first:  # before the store knows of it: a root whose key is lost has no successor
            write_secret(path, key_pem(root_key))
        if not await self._add(made, sealed) and first:  # another gateway was faster, and has its own
            path.unlink(missing_ok=True)

    async def _add(self, authority: Authority, sealed: bytes) -> bool:
        """Store it unless another gateway was faster; either way know what the store has now."""
        stored = stored_authority(authority, sealed, made_ns=self._clock.wall_ns())
        newest = self._held[0][0].id if self._held else ""
        added = await self._store.run(lambda engine: add_authority(engine, stored, newest=newest))
        await self._read()
        return added

    async def _read(self) -> None:
        def job(engine: StoreEngine) -> tuple[list[StoredAuthority], int]:
            with engine.transaction(write=False):
                return list_authorities(engine), renew_before(engine)

        rows, self.renew_before_ns = await self._store.read(job)
        if [(one.id, one.sealed_key) for one in rows] == [(authority.id, sealed) for authority, sealed in self._held]:
            return
        roots = [x509.load_pem_x509_certificates(one.root.encode()) for one in rows]
        self._held = [
            (Authority(root, _certificate(one.certificate)), one.sealed_key)
            for one, (root, *_) in zip(rows, roots, strict=True)
        ]
        held = {authority.id for authority, _ in self._held}
        self._opened = {one: authority for one, authority in self._opened.items() if one in held}
        self._vouchers = [voucher for _, *vouchers in roots for voucher in vouchers]
        self._issuer_keys = frozenset(subject_key(authority.certificate) for authority, _ in self._held)

    def _master(self) -> MasterKey:
        return MasterKey.load_or_make(self._data_dir, self._master_key)

    def _open(self, authority: Authority, sealed: bytes) -> PrivateKey:
        if not sealed:
            raise AuthorityError(
                "the fleet's certificates are issued by a gateway that was given --ca-key; not by this"
            )
        try:
            plain = self._master().open(PURPOSE, authority.id, sealed)
        except (DamagedError, ConfigError) as error:
            raise AuthorityError(
                f"the key that issues certificates was sealed by another master key than {self._master_key}"
                ": copy that file from the gateway that enrolled the first robot"
            ) from error
        key = serialization.load_pem_private_key(plain, password=None)
        if not isinstance(key, PrivateKey):
            raise AuthorityError("the sealed key is of a kind that issues nothing")
        return key


def stored_authority(
    authority: Authority, sealed: bytes, *, made_ns: int, vouchers: Sequence[x509.Certificate] = ()
) -> StoredAuthority:
    """An issuer as a row; `vouchers` are what earlier roots say of its root."""
    return StoredAuthority(
        id=authority.id,
        root=pem(authority.root, *vouchers),
        certificate=pem(authority.certificate),
        sealed_key=sealed,
        made_ns=made_ns,
        not_after_ns=authority.not_after_ns,
    )


def _certificate(text: str) -> x509.Certificate:
    return x509.load_pem_x509_certificate(text.encode())
