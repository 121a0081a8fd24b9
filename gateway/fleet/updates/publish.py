"""Publishes signed TUF documents: checks their order and signatures, then signs snapshot and timestamp.

Nothing is taken in part: documents that do not fit together change nothing. A gateway needs no secret of people's for
any of this, and can publish nothing that they did not sign. Functions run inside a transaction of the caller's.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC
from typing import TYPE_CHECKING, Any

from gateway.errors import DamagedError
from gateway.fleet.updates.errors import NoRootError, UpdateRefusedError
from gateway.fleet.updates.roles import (
    GROUP_PREFIX,
    GROUPS,
    ONLINE,
    ROLES,
    ROOT,
    SNAPSHOT,
    TARGETS,
    TIMESTAMP,
    Seal,
    encode,
    expiry,
    group_role,
    read_metadata,
    signer_of,
    verify_root,
    verify_signed,
)
from gateway.store.engine import StoreEngine
from gateway.store.fleet.updates import (
    StoredDocument,
    add_document,
    bundle_at,
    list_keys,
    lock_updates,
    newest_documents,
    next_version,
    read_document,
    trim_documents,
)
from metaros.errors import MetarosError
from metaros.fleet.bundle import target_path
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    from securesystemslib.signer import CryptoSigner
    from tuf.api import metadata as tuf
else:
    tuf = LazyModule("tuf.api.metadata")

__all__ = ["PURPOSE", "Upload", "due", "publish", "renew"]

PURPOSE = "update key"
KEPT_VERSIONS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Upload:
    """Signed documents that are to be published together; roots in order of their versions."""

    roots: Sequence[bytes] = ()
    targets: bytes | None = None
    groups: Mapping[str, bytes] | None = None


def publish(engine: StoreEngine, upload: Upload, seal: Seal, *, now_ns: int) -> dict[str, int]:
    """Check everything, keep it, and sign snapshot and timestamp anew; the newest version of each role.

    Raises:
        UpdateRefusedError: something is not signed, goes back, or does not fit; nothing was changed.
        NoRootError: there is no root, and none came.
    """
    lock_updates(engine)
    root = _take_roots(engine, upload.roots, now_ns=now_ns)
    targets = _take_targets(engine, root, upload.targets, now_ns=now_ns)
    _take_groups(engine, targets, upload.groups or {}, now_ns=now_ns)
    if targets is not None:
        _sign_snapshot(engine, root, seal, now_ns=now_ns)
    return {role: one.version for role, one in newest_documents(engine).items()}


def renew(engine: StoreEngine, seal: Seal, *, now_ns: int) -> bool:
    """Sign again what would end soon; whether anything was. UpdateRefusedError when this gateway cannot sign."""
    lock_updates(engine)
    found = newest_documents(engine)
    if ROOT not in found or TARGETS not in found:
        return False
    root = read_metadata(found[ROOT].document, tuf.Root, role=ROOT)
    if due(found.get(SNAPSHOT), SNAPSHOT, now_ns):
        _sign_snapshot(engine, root, seal, now_ns=now_ns)
        return True
    if due(found.get(TIMESTAMP), TIMESTAMP, now_ns):
        _sign_timestamp(engine, root, seal, now_ns=now_ns)
        return True
    return False


def due(document: StoredDocument | None, role: str, now_ns: int) -> bool:
    """Whether a role's newest document is to be followed by another one now."""
    left_ns = round(ROLES[role].renew_left.total_seconds() * 1e9)
    return document is None or document.expires_ns - now_ns < left_ns


def _take_roots(engine: StoreEngine, texts: Sequence[bytes], *, now_ns: int) -> tuf.Metadata[tuf.Root]:
    stored = read_document(engine, ROOT)
    root = read_metadata(stored.document, tuf.Root, role=ROOT) if stored is not None else None
    for text in texts:
        new = read_metadata(text, tuf.Root, role=ROOT)
        if root is not None and new.signed.version <= root.signed.version:
            _same(engine, ROOT, new.signed.version, text)
            continue
        if root is None and new.signed.version != 1:
            raise UpdateRefusedError("root: the first one that is published here is version 1")
        verify_root(root, new, now_ns=now_ns)
        _check_online(engine, new.signed)
        _keep(engine, ROOT, new, text, now_ns=now_ns)
        root = new
    if root is None:
        raise NoRootError("no root was published here yet: metaros update init-root, then metaros update publish")
    return root


def _check_online(engine: StoreEngine, root: tuf.Root) -> None:
    """The gateway has to be able to sign for it, or nothing could ever be published under it."""
    held = {key.keyid: key.role for key in list_keys(engine)}
    if not root.consistent_snapshot:
        raise UpdateRefusedError("root: consistent_snapshot is to be true")
    for role in ONLINE:
        row = root.roles[role]
        if row.threshold != 1 or not any(held.get(key_id) == role for key_id in row.keyids):
            raise UpdateRefusedError(f"root: {role} has none of this store's keys; metaros update online-keys has them")
    offline = {key_id for role in (ROOT, TARGETS) for key_id in root.roles[role].keyids}
    if offline & held.keys():
        raise UpdateRefusedError("root: a key of the gateway's may sign neither root nor targets")


def _take_targets(
    engine: StoreEngine, root: tuf.Metadata[tuf.Root], text: bytes | None, *, now_ns: int
) -> tuf.Metadata[tuf.Targets] | None:
    stored = read_document(engine, TARGETS)
    current = read_metadata(stored.document, tuf.Targets, role=TARGETS) if stored is not None else None
    if text is not None:
        new = read_metadata(text, tuf.Targets, role=TARGETS)
        if current is not None and new.signed.version == current.signed.version:
            _same(engine, TARGETS, new.signed.version, text)
        else:
            _follows(TARGETS, new, current)
            verify_signed(root.signed, TARGETS, new, now_ns=now_ns)
            _check_delegations(new.signed.delegations)
            _check_targets(engine, TARGETS, new.signed)
            _keep(engine, TARGETS, new, text, now_ns=now_ns)
            return new
    if current is not None:  # a root with other keys must not leave robots with targets that count no more
        verify_signed(root.signed, TARGETS, current, now_ns=0)
    return current


def _take_groups(
    engine: StoreEngine, targets: tuf.Metadata[tuf.Targets] | None, texts: Mapping[str, bytes], *, now_ns: int
) -> None:
    delegated = _delegated(targets)
    unknown = sorted(set(texts) - set(delegated))
    if unknown:
        raise UpdateRefusedError(f"{unknown[0][:80]}: targets delegates nothing to this role")
    for role in delegated:
        assert targets is not None
        stored = read_document(engine, role)
        current = read_metadata(stored.document, tuf.Targets, role=role) if stored is not None else None
        text = texts.get(role)
        new = read_metadata(text, tuf.Targets, role=role) if text is not None else None
        if new is not None and (current is None or new.signed.version != current.signed.version):
            _follows(role, new, current)
            verify_signed(targets.signed, role, new, now_ns=now_ns)
            if new.signed.delegations is not None:
                raise UpdateRefusedError(f"{role}: a group delegates to nobody")
            _check_targets(engine, role, new.signed)
            _keep(engine, role, new, text or b"", now_ns=now_ns)
        elif current is not None:
            if text is not None:
                _same(engine, role, current.signed.version, text)
            verify_signed(targets.signed, role, current, now_ns=0)
        else:
            raise UpdateRefusedError(f"{role}: targets delegates to it, and it was never signed")


def _delegated(targets: tuf.Metadata[tuf.Targets] | None) -> list[str]:
    if targets is None or targets.signed.delegations is None:
        return []
    return sorted(targets.signed.delegations.roles or {})


def _check_delegations(delegations: tuf.Delegations | None) -> None:
    if delegations is None:
        return
    if delegations.succinct_roles is not None or not delegations.roles or len(delegations.roles) > GROUPS:
        raise UpdateRefusedError(f"targets: it delegates to 1 to {GROUPS} roles robots/GROUP")
    for name, role in delegations.roles.items():
        group = name.removeprefix(GROUP_PREFIX)
        try:
            good = name == group_role(group)
        except MetarosError:
            good = False
        paths = role.paths or []
        if not good or not paths or any(not path.startswith(f"robots/{group}/") for path in paths):
            raise UpdateRefusedError(f"targets: the role {name[:80]} is to be robots/GROUP, with paths below its name")


def _check_targets(engine: StoreEngine, role: str, targets: tuf.Targets) -> None:
    """Every target is a bundle that is here, with the very bytes and the very words that are signed."""
    group = role.removeprefix(GROUP_PREFIX) if role.startswith(GROUP_PREFIX) else ""
    for path, target in targets.targets.items():
        custom: Any = target.custom or {}
        try:
            kind, name, version = (str(custom.get(key)) for key in ("kind", "name", "version"))
            named = target_path(kind, name, version, group=group)
        except (MetarosError, AttributeError):
            named = ""
        if path != named:
            raise UpdateRefusedError(f"{role}: {path[:120]} is not where its kind, name and version belong")
        _check_bundle(engine, role, path, target)


def _check_bundle(engine: StoreEngine, role: str, path: str, target: tuf.TargetFile) -> None:
    stored = bundle_at(engine, path)
    if stored is None:
        raise UpdateRefusedError(f"{role}: the bundle of {path} is not here: upload it first")
    if target.hashes.get("sha256") != stored.sha256 or target.length != stored.size_bytes:
        raise UpdateRefusedError(f"{role}: {path} was uploaded with other bytes than those that are signed")
    if target.custom != stored.manifest:
        raise UpdateRefusedError(f"{role}: {path} says something else of itself than what is signed")


def _follows(role: str, new: tuf.Metadata[Any], current: tuf.Metadata[Any] | None) -> None:
    if current is not None and new.signed.version < current.signed.version:
        raise UpdateRefusedError(f"{role}: version {new.signed.version} is older than {current.signed.version}, here")


def _same(engine: StoreEngine, role: str, version: int, text: bytes) -> None:
    """What is here already may come again, byte for byte."""
    stored = read_document(engine, role, version)
    if stored is None or stored.document != text:
        raise UpdateRefusedError(f"{role}: there is another version {version} here")


def _keep(engine: StoreEngine, role: str, metadata: tuf.Metadata[Any], text: bytes, *, now_ns: int) -> None:
    ends_ns = round(metadata.signed.expires.replace(tzinfo=metadata.signed.expires.tzinfo or UTC).timestamp()) * 10**9
    one = StoredDocument(role=role, version=metadata.signed.version, document=text, expires_ns=ends_ns)
    add_document(engine, one, now_ns=now_ns)
    if role != ROOT:
        trim_documents(engine, role, keep=KEPT_VERSIONS)


def _sign_snapshot(engine: StoreEngine, root: tuf.Metadata[tuf.Root], seal: Seal, *, now_ns: int) -> None:
    """Name the newest targets and groups; a role that was named once stays named, or robots would refuse it."""
    found = newest_documents(engine)
    meta = {
        f"{role}.json": _meta_file(one)
        for role, one in found.items()
        if role == TARGETS or role.startswith(GROUP_PREFIX)
    }
    version = next_version(engine, found.get(SNAPSHOT))
    snapshot = tuf.Snapshot(version=version, expires=expiry(SNAPSHOT, now_ns), meta=meta)
    _sign(engine, root, SNAPSHOT, tuf.Metadata(snapshot), seal, now_ns=now_ns)
    _sign_timestamp(engine, root, seal, now_ns=now_ns)


def _sign_timestamp(engine: StoreEngine, root: tuf.Metadata[tuf.Root], seal: Seal, *, now_ns: int) -> None:
    found = newest_documents(engine)
    version = next_version(engine, found.get(TIMESTAMP))
    ends = expiry(TIMESTAMP, now_ns)
    timestamp = tuf.Timestamp(version=version, expires=ends, snapshot_meta=_meta_file(found[SNAPSHOT]))
    _sign(engine, root, TIMESTAMP, tuf.Metadata(timestamp), seal, now_ns=now_ns)


def _meta_file(one: StoredDocument) -> tuf.MetaFile:
    return tuf.MetaFile(one.version, len(one.document), {"sha256": hashlib.sha256(one.document).hexdigest()})


def _sign(
    engine: StoreEngine,
    root: tuf.Metadata[tuf.Root],
    role: str,
    metadata: tuf.Metadata[Any],
    seal: Seal,
    *,
    now_ns: int,
) -> None:
    metadata.sign(_signer(engine, root.signed, role, seal))
    _keep(engine, role, metadata, encode(metadata), now_ns=now_ns)


def _signer(engine: StoreEngine, root: tuf.Root, role: str, seal: Seal) -> CryptoSigner:
    """The key of that role that the root names and this gateway can open."""
    for key in list_keys(engine):
        if key.role == role and key.keyid in root.roles[role].keyids:
            try:
                private = seal.open(PURPOSE, key.keyid, key.sealed)
            except DamagedError:
                continue
            return signer_of(private)
    raise UpdateRefusedError(f"{role}: this gateway cannot sign it: another gateway's master key sealed the key")
