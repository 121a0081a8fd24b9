"""The authority of this gateway: made at first need, its key sealed in the store, or supplied as files.

All gateways on one database share it. One that has another master key recognises every robot, but issues nothing: it
cannot open the key, and says which file to copy.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from gateway.errors import AuthorityError, DamagedError
from gateway.identity.ca import Authority, PrivateKey, key_pem, make_intermediate, make_root, pem, supplied
from gateway.identity.master import MASTER_KEY, MasterKey
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.identities import StoredAuthority, add_authority, list_authorities
from metaros.clock import Clock
from metaros.errors import ConfigError

__all__ = ["ROOT_KEY", "Authorities"]

log = logging.getLogger(__name__)

ROOT_KEY = "ca-root.key"
PURPOSE = "ca"
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
    ) -> None:
        """`ca_cert` and `ca_key` name an issuer made elsewhere; ConfigError when it cannot issue."""
        self.fleet = fleet
        self._store = store
        self._data_dir = data_dir
        self._clock = clock
        self._held: list[Held] = []
        self._opened: Authority | None = None
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
            return self._supplied
        if not self._held:
            await self._read()
        if not self._held or self._ends_soon():
            await self._make()
        newest, sealed = self._held[0]
        if self._opened is None or self._opened.id != newest.id:
            key = self._open(newest, sealed)
            self._opened = Authority(newest.root, newest.certificate, key)
        return self._opened

    def _ends_soon(self) -> bool:
        """Whether the newest issuer should be followed by another, and the root's key is here to make it."""
        newest, sealed = self._held[0]
        left_ns = newest.not_after_ns - self._clock.wall_ns()
        return bool(sealed) and left_ns < RENEW_NS and (self._data_dir / ROOT_KEY).exists()

    async def _make(self) -> None:
        """A first issuer with its root, or the next one under the root that there is."""
        now_ns = self._clock.wall_ns()
        if self._held:
            root, root_key = self._held[0][0].root, _read_key(self._data_dir / ROOT_KEY)
        else:
            root, root_key = make_root(self.fleet, now_ns=now_ns)
        made = make_intermediate(self.fleet, root, root_key, now_ns=now_ns)
        if made.key is None:
            raise AuthorityError("a new issuer has no key")
        sealed = self._master().seal(PURPOSE, made.id, key_pem(made.key))
        first = not self._held
        if await self._add(made, sealed) and first:
            _write_secret(self._data_dir / ROOT_KEY, key_pem(root_key))

    async def _add(self, authority: Authority, sealed: bytes) -> bool:
        """Store it unless another gateway was faster; either way know what the store has now."""
        stored = StoredAuthority(
            id=authority.id,
            root=pem(authority.root),
            certificate=pem(authority.certificate),
            sealed_key=sealed,
            made_ns=self._clock.wall_ns(),
            not_after_ns=authority.not_after_ns,
        )
        newest = self._held[0][0].id if self._held else ""
        added = await self._store.run(lambda engine: add_authority(engine, stored, newest=newest))
        await self._read()
        return added

    async def _read(self) -> None:
        def job(engine: StoreEngine) -> list[StoredAuthority]:
            with engine.transaction(write=False):
                return list_authorities(engine)

        self._held = [
            (Authority(_certificate(one.root), _certificate(one.certificate)), one.sealed_key)
            for one in await self._store.read(job)
        ]

    def _master(self) -> MasterKey:
        return MasterKey.load_or_make(self._data_dir)

    def _open(self, authority: Authority, sealed: bytes) -> PrivateKey:
        if not sealed:
            raise AuthorityError(
                "the fleet's certificates are issued by a gateway that was given --ca-key; not by this"
            )
        try:
            plain = self._master().open(PURPOSE, authority.id, sealed)
        except (DamagedError, ConfigError) as error:
            raise AuthorityError(
                f"the key that issues certificates was sealed by another master key than {self._data_dir / MASTER_KEY}"
                ": copy that file from the gateway that enrolled the first robot"
            ) from error
        key = serialization.load_pem_private_key(plain, password=None)
        if not isinstance(key, PrivateKey):
            raise AuthorityError("the sealed key is of a kind that issues nothing")
        return key


def _certificate(text: str) -> x509.Certificate:
    return x509.load_pem_x509_certificate(text.encode())


def _read_key(path: Path) -> ec.EllipticCurvePrivateKey:
    try:
        key = serialization.load_pem_private_key(path.read_bytes(), password=None)
    except (OSError, ValueError, TypeError) as error:
        raise AuthorityError(f"the root's key {path} cannot be read: {error}") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise AuthorityError(f"the root's key {path} is not the one that this gateway made")
    return key


def _write_secret(path: Path, data: bytes) -> None:
    """Write a file that nobody else can read, whole or not at all."""
    partial = path.with_name(path.name + ".partial")
    partial.unlink(missing_ok=True)
    with os.fdopen(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
