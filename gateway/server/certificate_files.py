"""A certificate and its key in files that somebody else looks after: read, checked, and read anew when they change."""

from __future__ import annotations

import contextlib
import logging
import ssl
import warnings
from datetime import UTC, datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat, load_pem_private_key
from cryptography.x509.verification import PolicyBuilder, Store, VerificationError

from metaros.clock import Clock
from metaros.errors import ConfigError

__all__ = ["CertificateFiles"]

log = logging.getLogger(__name__)

MAX_BYTES = 256 * 1024
WARN_DAYS = 7


class CertificateFiles:
    """`--tls-cert` and `--tls-key`."""

    def __init__(self, cert: Path, key: Path, *, clock: Clock) -> None:
        self._cert = cert
        self._key = key
        self._clock = clock
        self._trusted = False
        self._names: set[str] = set()
        self._addresses = False

    @property
    def is_trusted(self) -> bool:
        """Whether this system trusted the certificate, for a host name, when it was read."""
        return self._trusted

    def holds(self, name: str | None) -> bool:
        """Whether the certificate is for the host name by which somebody calls; None: by an address."""
        if name is None:
            return self._addresses
        wild = f"*.{name.partition('.')[2]}"
        return bool({name.lower(), wild.lower()} & self._names)

    def stamp(self) -> object:
        """Another value after each change of one of the files; equal while neither changes."""
        return tuple(_facts(path) for path in (self._cert, self._key))

    def read(self) -> tuple[bytes, bytes]:
        """Chain and key in PEM.

        Raises:
            ConfigError: they cannot serve; the message says which of them and why.
        """
        chain_pem, key_pem = _text("--tls-cert", self._cert), _text("--tls-key", self._key)
        chain = self._read_chain(chain_pem)
        self._check_key(key_pem, chain[0])
        self._names, self._addresses = _names(chain[0])
        self._trusted = _is_trusted(chain, self._now())
        return chain_pem, key_pem

    def _read_chain(self, text: bytes) -> list[x509.Certificate]:
        try:
            chain = x509.load_pem_x509_certificates(text)
        except ValueError as error:
            raise ConfigError(f"--tls-cert {self._cert}: no certificate in PEM ({error})") from error
        leaf, now = chain[0], self._now()
        if now >= leaf.not_valid_after_utc:
            raise ConfigError(f"--tls-cert {self._cert}: expired on {leaf.not_valid_after_utc:%Y-%m-%d %H:%M}Z")
        if now < leaf.not_valid_before_utc:
            begin = f"{leaf.not_valid_before_utc:%Y-%m-%d %H:%M}Z"
            raise ConfigError(f"--tls-cert {self._cert}: not valid before {begin}, and it is {now:%Y-%m-%d %H:%M}Z")
        if (leaf.not_valid_after_utc - now).days < WARN_DAYS:
            log.warning("--tls-cert %s expires on %s", self._cert, leaf.not_valid_after_utc.isoformat())
        return chain

    def _check_key(self, text: bytes, leaf: x509.Certificate) -> None:
        try:
            key = load_pem_private_key(text, password=None)
        except TypeError as error:
            fix = f"openssl pkey -in {self._key} -out plain.key"
            raise ConfigError(f"--tls-key {self._key}: encrypted; the gateway needs it plain\n{fix}") from error
        except ValueError as error:
            raise ConfigError(f"--tls-key {self._key}: no private key in PEM") from error
        kind = (Encoding.DER, PublicFormat.SubjectPublicKeyInfo)
        if key.public_key().public_bytes(*kind) != leaf.public_key().public_bytes(*kind):
            raise ConfigError(f"--tls-key {self._key}: not the key of the first certificate in {self._cert}")

    def _now(self) -> datetime:
        return datetime.fromtimestamp(self._clock.wall_ns() // 1_000_000_000, UTC)


def _text(flag: str, path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            text = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{flag} {path}: {error.strerror or error}") from error
    if len(text) > MAX_BYTES:
        raise ConfigError(f"{flag} {path}: over {MAX_BYTES // 1024} KiB")
    return text


def _facts(path: Path) -> tuple[int, ...]:
    with contextlib.suppress(OSError):
        found = path.stat()
        return found.st_ino, found.st_mtime_ns, found.st_size
    return ()


def _names(leaf: x509.Certificate) -> tuple[set[str], bool]:
    """The host names, and whether there are addresses."""
    try:
        names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return set(), False
    dns = {name.lower() for name in names.get_values_for_type(x509.DNSName)}
    return dns, bool(names.get_values_for_type(x509.IPAddress))


def _is_trusted(chain: list[x509.Certificate], now: datetime) -> bool:
    """Whether this system's authorities vouch for the chain under one of its host names."""
    try:
        name = min(_names(chain[0])[0], default="").replace("*.", "any.", 1)
        system = ssl.create_default_context().get_ca_certs(binary_form=True)
        with warnings.catch_warnings(action="ignore"):  # some system's roots have serial numbers of old times
            store = Store([x509.load_der_x509_certificate(found) for found in system])
        verifier = PolicyBuilder().store(store).time(now).build_server_verifier(x509.DNSName(name))
        verifier.verify(chain[0], chain[1:])
    except (VerificationError, ValueError):
        return False
    return True
