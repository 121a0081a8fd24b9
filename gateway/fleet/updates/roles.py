"""The roles of the update repository, and how their metadata is read and written.

Root and targets are signed by people on a machine of their own, and their keys never come near a gateway. Snapshot and
timestamp are signed by the gateway, again and again: whoever steals those keys can keep robots from learning of
anything new for a few days, and can make them run nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any, Protocol

from gateway.fleet.updates.errors import UpdateRefusedError
from metaros.fleet.bundle import check_group
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    from securesystemslib import signer as signing
    from tuf.api import exceptions
    from tuf.api import metadata as tuf
    from tuf.api.serialization import json as serialization
else:  # with AWS's library in it; most gateways sign nothing
    signing, exceptions = LazyModule("securesystemslib.signer"), LazyModule("tuf.api.exceptions")
    tuf, serialization = LazyModule("tuf.api.metadata"), LazyModule("tuf.api.serialization.json")

__all__ = [
    "GROUPS",
    "GROUP_PREFIX",
    "METADATA_BYTES",
    "ONLINE",
    "ROLES",
    "ROOT",
    "SNAPSHOT",
    "TARGETS",
    "TIMESTAMP",
    "RoleRow",
    "Seal",
    "encode",
    "expiry",
    "group_role",
    "new_signer",
    "public_keys",
    "read_metadata",
    "signer_of",
    "verify_root",
    "verify_signed",
]

ROOT, TARGETS, SNAPSHOT, TIMESTAMP = "root", "targets", "snapshot", "timestamp"  # as The Update Framework calls them
GROUP_PREFIX = "robots/"
GROUPS = 31  # delegated roles; robots look no further
METADATA_BYTES = 512_000  # of one document; robots take no larger root


@dataclass(frozen=True, slots=True, kw_only=True)
class RoleRow:
    """One role: where its keys are, how long its signature counts, and how much of that is left when it is renewed."""

    name: str
    online: bool
    life: timedelta
    renew_left: timedelta
    keys: int
    threshold: int


ROLES: dict[str, RoleRow] = {
    row.name: row
    for row in (
        RoleRow(name=ROOT, online=False, life=timedelta(days=365), renew_left=timedelta(days=60), keys=3, threshold=2),
        RoleRow(
            name=TARGETS, online=False, life=timedelta(days=90), renew_left=timedelta(days=14), keys=1, threshold=1
        ),
        RoleRow(name=SNAPSHOT, online=True, life=timedelta(days=7), renew_left=timedelta(days=3), keys=1, threshold=1),
        RoleRow(
            name=TIMESTAMP,
            online=True,
            life=timedelta(days=1),
            renew_left=timedelta(hours=12),
            keys=1,
            threshold=1,
        ),
    )
}
ONLINE = tuple(row.name for row in ROLES.values() if row.online)


class Seal(Protocol):
    """Seals what lies in the database, and opens it again: the gateway's master key."""

    def seal(self, purpose: str, secret_id: str, plain: bytes) -> bytes:
        """The secret for the database."""

    def open(self, purpose: str, secret_id: str, sealed: bytes) -> bytes:
        """The secret again; DamagedError when it was sealed by another key."""


class Delegator(Protocol):
    """Root or targets: says which keys count for a role."""

    def verify_delegate(self, delegated_role: str, payload: bytes, signatures: dict[str, Any]) -> None:
        """Raise unless enough of them signed."""


def group_role(group: str) -> str:
    """The delegated role of a group; BundleError when that is no name."""
    return GROUP_PREFIX + check_group(group)


def expiry(role: str, now_ns: int) -> datetime:
    """Until when what is signed now counts; a group's role lives as long as targets."""
    row = ROLES.get(role, ROLES[TARGETS])
    return datetime.fromtimestamp(now_ns // 10**9, UTC) + row.life


def encode(metadata: tuf.Metadata[Any]) -> bytes:
    """The document as it is kept and served."""
    return metadata.to_bytes(serialization.JSONSerializer(compact=True))


def read_metadata(text: bytes, kind: type[tuf.Signed], *, role: str) -> tuf.Metadata[Any]:
    """A document of that kind; UpdateRefusedError when it is none."""
    if len(text) > METADATA_BYTES:
        raise UpdateRefusedError(f"{role}: the document has {len(text)} bytes, at most {METADATA_BYTES} may come")
    try:
        found: tuf.Metadata[Any] = tuf.Metadata.from_bytes(text)
    except (exceptions.RepositoryError, ValueError, RecursionError) as error:
        raise UpdateRefusedError(f"{role}: this is no signed metadata: {str(error)[:200]}") from error
    if not isinstance(found.signed, kind):
        raise UpdateRefusedError(f"{role}: this is {found.signed.type[:20]} metadata")
    return found


def verify_signed(delegator: Delegator, role: str, metadata: tuf.Metadata[Any], *, now_ns: int) -> None:
    """UpdateRefusedError unless enough of the role's keys signed it and it has not expired."""
    payload = serialization.CanonicalJSONSerializer().serialize(metadata.signed)
    try:
        delegator.verify_delegate(role, payload, metadata.signatures)
    except (tuf.UnsignedMetadataError, ValueError) as error:
        raise UpdateRefusedError(f"{role}: not signed by enough of its keys: {str(error)[:200]}") from error
    _check_fresh(role, metadata, now_ns)


def verify_root(previous: tuf.Metadata[tuf.Root] | None, root: tuf.Metadata[tuf.Root], *, now_ns: int) -> None:
    """UpdateRefusedError unless it follows `previous` and enough keys of both signed it."""
    if previous is None and root.signed.version < 1:
        raise UpdateRefusedError("root: the first version is 1")
    try:
        payload = serialization.CanonicalJSONSerializer().serialize(root.signed)
        result = root.signed.get_root_verification_result(
            previous.signed if previous is not None else None, payload, root.signatures
        )
    except ValueError as error:
        raise UpdateRefusedError(f"root: {str(error)[:200]}") from error
    if not result:
        raise UpdateRefusedError("root: not signed by enough keys of this version and of the one before")
    _check_fresh(ROOT, root, now_ns)


def new_signer() -> signing.CryptoSigner:
    """A new online key."""
    return signing.CryptoSigner.generate_ed25519()


def signer_of(private: bytes) -> signing.CryptoSigner:
    """The signer of an unencrypted PEM: an online key that was opened."""
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    return signing.CryptoSigner(load_pem_private_key(private, None))


def public_keys(document: Mapping[str, Any]) -> dict[str, signing.Key]:
    """Keys by role, of what `metaros update online-keys` prints; UpdateRefusedError when it is something else."""
    try:
        return {role: signing.Key.from_dict(document[role]["keyid"], dict(document[role]["key"])) for role in ONLINE}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UpdateRefusedError("these are no online keys: metaros update online-keys prints them") from error


def _check_fresh(role: str, metadata: tuf.Metadata[Any], now_ns: int) -> None:
    if metadata.signed.is_expired(datetime.fromtimestamp(now_ns // 10**9, UTC)):
        raise UpdateRefusedError(f"{role}: it ended at {metadata.signed.expires:%Y-%m-%d %H:%M} UTC")
