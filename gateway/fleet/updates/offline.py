"""The offline half of the update repository: pure functions on a folder, for the people's own machine; no gateway.

    FOLDER/online.json          the public keys of the gateway's two roles, carried here by people
    FOLDER/keys/*.pem           private keys, each encrypted with the passphrase of who holds it
    FOLDER/draft.json           the targets that the next signature will hold
    FOLDER/bundles/…            the bundles themselves, as they will be uploaded
    FOLDER/metadata/N.ROLE.json what was signed; the highest number of each role counts

The root's keys belong to three people: they may be taken to three machines, and a new root be signed on one after the
other (`sign` adds a signature to the same version until it has enough).
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    PrivateFormat,
    load_pem_private_key,
)
from securesystemslib.signer import CryptoSigner
from tuf.api.metadata import DelegatedRole, Delegations, Metadata, Root, TargetFile, Targets

from gateway.fleet.updates.errors import UpdateRefusedError
from gateway.fleet.updates.roles import (
    GROUP_PREFIX,
    GROUPS,
    ONLINE,
    ROLES,
    encode,
    expiry,
    group_role,
    public_keys,
    read_metadata,
    verify_root,
)
from metaros.errors import ConfigError
from metaros.fleet.bundle import read_bundle, target_path

__all__ = ["Passphrase", "Release", "add", "init_root", "release", "remove", "rotate_root", "sign_role", "sign_root"]

Passphrase = Callable[[str], bytes]  # asked for by the name of the key's file
PASSPHRASE_CHARS = 8
DRAFT = "draft.json"
PIECE_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class Release:
    """What a folder has to publish: roots in order, other roles' newest documents, and bundles by target path."""

    roots: tuple[bytes, ...]
    targets: bytes
    groups: dict[str, bytes]
    bundles: dict[str, Path]


def init_root(folder: Path, online: dict[str, Any], passphrase: Passphrase, *, now_ns: int) -> Metadata[Root]:
    """Make the keys of root and targets and the first root, signed by all three.

    Raises:
        ConfigError: the folder has a root already, or a passphrase is too short.
        UpdateRefusedError: `online` holds no keys.
    """
    if _newest(folder, Root.type) is not None:
        raise ConfigError(f"{folder} has a root already; metaros update sign root --rotate follows it by another")
    public = public_keys(online)
    _make(folder)
    _write(folder / "online.json", json.dumps(online, indent=2).encode())
    root = Root(version=1, expires=expiry(Root.type, now_ns), consistent_snapshot=True)
    signers = []
    for role in (Root.type, Targets.type):
        for number in range(1, ROLES[role].keys + 1):
            signer = _make_key(folder, f"{role}-{number}", passphrase)
            root.add_key(signer.public_key, role)
            signers += [signer] if role == Root.type else []
        root.roles[role].threshold = ROLES[role].threshold
    for role in ONLINE:
        root.add_key(public[role], role)
    signed = Metadata(root)
    for signer in signers:
        signed.sign(signer, append=True)
    _keep(folder, Root.type, signed)
    _write_draft(folder, {"targets": {}, "groups": {}})
    return signed


def rotate_root(
    folder: Path, *, online: dict[str, Any] | None, replace: str, passphrase: Passphrase, now_ns: int
) -> Metadata[Root]:
    """A next root, unsigned as yet: with other online keys, another key in place of `replace` (`root-2`), or only a
    later end. `sign_root` signs it.
    """
    before = _current_root(folder)
    root = Root.from_dict(json.loads(json.dumps(before.signed.to_dict())))
    root.version += 1
    root.expires = expiry(Root.type, now_ns)
    if online is not None:
        public = public_keys(online)
        for role in ONLINE:
            for key_id in list(root.roles[role].keyids):
                root.revoke_key(key_id, role)
            root.add_key(public[role], role)
        _write(folder / "online.json", json.dumps(online, indent=2).encode())
    if replace:
        role = replace.rpartition("-")[0]
        if role not in (Root.type, Targets.type):
            raise ConfigError(f"--replace {replace}: one of root-1, root-2, root-3 and targets-1")
        old = _public_id(folder, replace)
        if old not in root.roles[role].keyids:
            raise ConfigError(f"the key {replace} is not one of the root's")
        os.replace(_key_path(folder, replace), _key_path(folder, f"{replace}.old-{before.signed.version}"))
        signer = _make_key(folder, replace, passphrase)
        root.revoke_key(old, role)
        root.add_key(signer.public_key, role)
    made: Metadata[Root] = Metadata(root)
    _keep(folder, Root.type, made)
    return made


def sign_root(folder: Path, names: Sequence[str], passphrase: Passphrase, *, now_ns: int) -> bool:
    """Add these keys' signatures (`root-1`) to the newest root; whether it has enough by now."""
    root = _current_root(folder)
    for name in names:
        root.sign(_signer(folder, name, passphrase), append=True)
    _keep(folder, Root.type, root)
    before = _read(folder, Root.type, root.signed.version - 1) if root.signed.version > 1 else None
    try:
        verify_root(before, root, now_ns=now_ns)
    except UpdateRefusedError:
        return False
    return True


def add(folder: Path, bundle: Path, *, group: str = "", passphrase: Passphrase | None = None) -> str:
    """Check a bundle, copy it and put it into the draft; its target path. A group's first one makes the group's key.

    Raises:
        BundleError: it is no bundle.
        ConfigError: there is another one of that version already.
    """
    manifest = read_bundle(bundle)
    path = target_path(manifest.kind, manifest.name, manifest.version, group=group)
    draft = _draft(folder)
    if group and group not in draft["groups"]:
        if len(draft["groups"]) >= GROUPS:
            raise ConfigError(f"there are {GROUPS} groups already, which is as many as robots look at")
        if passphrase is None:
            raise ConfigError(f"the group {group} is new, and its key needs a passphrase")
        _make_key(folder, _group_key(group), passphrase)
        draft["groups"][group] = {}
    held: dict[str, Any] = draft["groups"][group] if group else draft["targets"]
    digest, size_bytes = _digest(bundle)
    entry = {"length": size_bytes, "sha256": digest, "custom": manifest.custom}
    if held.get(path, entry) != entry:
        raise ConfigError(f"{path} is there already with other bytes: a version is for ever, so take the next number")
    kept = folder / "bundles" / path
    kept.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(bundle, kept)
    held[path] = entry
    _write_draft(folder, draft)
    return path


def remove(folder: Path, path: str) -> None:
    """Take a target out of the draft: the next signature does not hold it. ConfigError when it is not in it."""
    draft = _draft(folder)
    for held in (draft["targets"], *draft["groups"].values()):
        if held.pop(path, None) is not None:
            _write_draft(folder, draft)
            return
    raise ConfigError(f"{path} is no target of {folder}")


def sign_role(folder: Path, role: str, passphrase: Passphrase, *, now_ns: int) -> Metadata[Targets]:
    """Sign the draft of targets, or of a group's `robots/NAME`, as the next version."""
    draft = _draft(folder)
    if role == Targets.type:
        held, key = draft["targets"], f"{Targets.type}-1"
    else:
        group = role.removeprefix(GROUP_PREFIX)
        if not role.startswith(GROUP_PREFIX) or group not in draft["groups"]:
            raise ConfigError(f"{role[:80]} is no role of {folder}: targets, or robots/ and a group")
        held, key = draft["groups"][group], _group_key(group)
    newest = _newest(folder, role)
    targets = Targets(
        version=(newest or 0) + 1,
        expires=expiry(role, now_ns),
        targets={path: _target_file(path, entry) for path, entry in sorted(held.items())},
        delegations=_delegations(folder, sorted(draft["groups"])) if role == Targets.type else None,
    )
    signed: Metadata[Targets] = Metadata(targets)
    signed.sign(_signer(folder, key, passphrase))
    _keep(folder, role, signed)
    return signed


def release(folder: Path) -> Release:
    """Everything that a folder has to publish. ConfigError when targets were never signed."""
    top = _newest(folder, Root.type) or 0
    if not top or _newest(folder, Targets.type) is None:
        raise ConfigError(f"{folder} has nothing signed yet: metaros update sign targets --folder {folder}")
    targets = _read(folder, Targets.type, _newest(folder, Targets.type) or 0)
    groups, held = {}, dict(targets.signed.targets)
    for group in _draft(folder)["groups"]:
        number = _newest(folder, group_role(group))
        if number is None:
            raise ConfigError(f"the group {group} is not signed yet: metaros update sign robots/{group}")
        document = _read(folder, group_role(group), number)
        groups[group_role(group)] = _path(folder, group_role(group), number).read_bytes()
        held |= document.signed.targets
    return Release(
        roots=tuple(_path(folder, Root.type, number).read_bytes() for number in range(1, top + 1)),
        targets=_path(folder, Targets.type, targets.signed.version).read_bytes(),
        groups=groups,
        bundles={path: folder / "bundles" / path for path in sorted(held)},
    )


def _delegations(folder: Path, groups: Sequence[str]) -> Delegations | None:
    if not groups:
        return None
    keys, roles = {}, {}
    for group in groups:
        key = _public(folder, _group_key(group))
        keys[key.keyid] = key
        paths = [f"robots/{group}/*/*/*"]
        roles[group_role(group)] = DelegatedRole(group_role(group), [key.keyid], 1, terminating=True, paths=paths)
    return Delegations(keys, roles)


def _target_file(path: str, entry: dict[str, Any]) -> TargetFile:
    return TargetFile(entry["length"], {"sha256": entry["sha256"]}, path, {"custom": entry["custom"]})


def _group_key(group: str) -> str:
    return f"group-{group}"


def _make_key(folder: Path, name: str, passphrase: Passphrase) -> CryptoSigner:
    """A new key in the folder, encrypted; its public half beside it."""
    secret = passphrase(name)
    if len(secret) < PASSPHRASE_CHARS:
        raise ConfigError(f"the passphrase of {name} is shorter than {PASSPHRASE_CHARS} characters")
    signer = CryptoSigner.generate_ed25519()
    private = load_pem_private_key(signer.private_bytes, None)
    pem = private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(secret))
    path = _key_path(folder, name)
    if path.exists():
        raise ConfigError(f"{path} is there already")
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(pem)
    public = {"keyid": signer.public_key.keyid, "key": signer.public_key.to_dict()}
    _write(folder / "keys" / f"{name}.public.json", json.dumps(public).encode())
    return signer


def _signer(folder: Path, name: str, passphrase: Passphrase) -> CryptoSigner:
    path = _key_path(folder, name)
    try:
        pem = path.read_bytes()
        return CryptoSigner(load_pem_private_key(pem, passphrase(name)))
    except OSError as error:
        raise ConfigError(f"the key {path} cannot be read: {error.strerror or error}") from error
    except (ValueError, TypeError) as error:
        raise ConfigError(f"the key {path} is not opened by this passphrase") from error


def _public(folder: Path, name: str) -> Any:
    from securesystemslib.signer import Key

    found = json.loads((folder / "keys" / f"{name}.public.json").read_bytes())
    return Key.from_dict(found["keyid"], found["key"])


def _public_id(folder: Path, name: str) -> str:
    return str(_public(folder, name).keyid)


def _key_path(folder: Path, name: str) -> Path:
    return folder / "keys" / f"{name}.pem"


def _make(folder: Path) -> None:
    for each in (folder, folder / "keys", folder / "metadata", folder / "bundles"):
        each.mkdir(mode=0o700, parents=True, exist_ok=True)


def _draft(folder: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads((folder / DRAFT).read_bytes())
    except (OSError, ValueError) as error:
        raise ConfigError(f"{folder} is no update folder: metaros update init-root makes one") from error
    return found


def _write_draft(folder: Path, draft: dict[str, Any]) -> None:
    _write(folder / DRAFT, json.dumps(draft, indent=2, sort_keys=True).encode())


def _path(folder: Path, role: str, version: int) -> Path:
    return folder / "metadata" / f"{version}.{role.replace('/', '%2F')}.json"


def _newest(folder: Path, role: str) -> int | None:
    pattern = re.compile(rf"(\d+)\.{re.escape(role.replace('/', '%2F'))}\.json")
    names = (folder / "metadata").iterdir() if (folder / "metadata").is_dir() else ()
    return max((int(match[1]) for path in names if (match := pattern.fullmatch(path.name))), default=None)


def _read(folder: Path, role: str, version: int) -> Metadata[Any]:
    return read_metadata(_path(folder, role, version).read_bytes(), Root if role == Root.type else Targets, role=role)


def _current_root(folder: Path) -> Metadata[Root]:
    newest = _newest(folder, Root.type)
    if newest is None:
        raise ConfigError(f"{folder} has no root: metaros update init-root makes one")
    return _read(folder, Root.type, newest)


def _keep(folder: Path, role: str, metadata: Metadata[Any]) -> None:
    _write(_path(folder, role, metadata.signed.version), encode(metadata))


def _write(path: Path, data: bytes) -> None:
    """Whole or not at all."""
    partial = path.with_name(f".{path.name}.partial")
    with partial.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)


def _digest(path: Path) -> tuple[str, int]:
    digest, size_bytes = hashlib.sha256(), 0
    with path.open("rb") as file:
        while piece := file.read(PIECE_BYTES):
            digest.update(piece)
            size_bytes += len(piece)
    return digest.hexdigest(), size_bytes
