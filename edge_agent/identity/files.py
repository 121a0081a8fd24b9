"""The robot's identity on its disk: one file, replaced as a whole, so that key and certificate always belong together.

`identity/identity.json` is what holds. `pending.json` beside it is a key for which a certificate was asked with a token
and not yet received, `renewal.json` the same of a renewal: the answer may be lost, and the gateway gives it again for
the same key alone, so neither may take the other's away. `token.json` is the hash of the token that was used last: who
gives the same command again is told that it is done, and rings no alarm. All have mode 0600.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import sys
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from edge_agent.errors import IdentityFileError
from edge_agent.identity.certificate import certificates_der, validity_of
from edge_agent.identity.key import PrivateKey, key_from_pem, key_to_pem, new_key

__all__ = ["IdentityFiles", "RobotIdentity"]

IDENTITY, PENDING, RENEWAL, TOKEN = "identity.json", "pending.json", "renewal.json", "token.json"
FILE_BYTES = 256 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotIdentity:
    """What an enrolled robot has. All certificates and the key are PEM texts."""

    robot: str
    fleet: str
    url: str  # of the gateway's HTTP API, where the certificate is renewed
    system_trust: bool  # whether its TLS is vouched for by this system's authorities, not by the fleet's root
    grpc_port: int  # the link over gRPC, on the same host; 0 = none
    grpc_tls: bool
    certificate: str
    chain: str
    roots: str
    key: str = field(repr=False)

    def private_key(self) -> PrivateKey:
        """The key. Raises IdentityFileError."""
        return key_from_pem(self.key)

    def certificates(self) -> list[bytes]:
        """Its own certificate and what leads to the root, as DER."""
        return certificates_der(self.certificate, self.chain)


class IdentityFiles:
    """The folder `identity` in an agent's state directory. Methods block, and raise IdentityFileError."""

    def __init__(self, state_dir: Path) -> None:
        self.folder = state_dir / "identity"

    def exists(self) -> bool:
        """Whether the robot was ever enrolled, be its files good or not."""
        return (self.folder / IDENTITY).exists()

    def load(self) -> RobotIdentity | None:
        """What holds now; None for a robot that was never enrolled."""
        table = self._read(IDENTITY)
        if table is None:
            return None
        kinds = {item.name: {"str": str, "int": int, "bool": bool}[str(item.type)] for item in fields(RobotIdentity)}
        if table.keys() != kinds.keys() or any(type(table[name]) is not kind for name, kind in kinds.items()):
            raise IdentityFileError(f"{self.folder / IDENTITY} is not what this agent writes: enrol the robot again")
        identity = RobotIdentity(**table)
        try:
            validity_of(identity.certificate)
            identity.certificates()
        except ValueError as error:
            raise IdentityFileError(f"{self.folder / IDENTITY}: no certificate: {error}") from error
        identity.private_key()
        return identity

    def save(self, identity: RobotIdentity, *, token: str = "") -> None:
        """Put it in the place of what held, on the disk before this returns; what was pending for it is done.

        `token` is the text of the one that brought it; "": a renewal did.
        """
        self._replace(IDENTITY, asdict(identity))
        if token:
            self._replace(TOKEN, {"sha256": _hash(token)})
            self.forget_pending()
        self.forget_pending(renewal=True)

    def brought_by(self, token: str) -> RobotIdentity | None:
        """What holds, if this very token brought it, by whatever certificates since; else None."""
        table = self._read(TOKEN)
        return self.load() if table is not None and table.get("sha256") == _hash(token) else None

    def pending_key(self, purpose: str, *, renewal: bool = False) -> PrivateKey:
        """The key to ask a certificate for: the one of an earlier attempt with the same purpose, else a new one.

        `purpose` is the token's id, or with `renewal` the certificate that is to be renewed.
        """
        name = RENEWAL if renewal else PENDING
        table = self._read(name)
        if table is not None and table.get("purpose") == purpose and isinstance(table.get("key"), str):
            return key_from_pem(table["key"])
        key = new_key()
        self._replace(name, {"purpose": purpose, "key": key_to_pem(key)})
        return key

    def forget_pending(self, *, renewal: bool = False) -> None:
        """No answer is waited for any more."""
        path = self.folder / (RENEWAL if renewal else PENDING)
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise IdentityFileError(f"cannot delete {path}: {error.strerror}") from error

    def _read(self, name: str) -> dict[str, Any] | None:
        path = self.folder / name
        try:
            with path.open("rb") as file:
                mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
                data = file.read(FILE_BYTES)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise IdentityFileError(f"cannot read {path}: {error.strerror}") from error
        if sys.platform != "win32" and mode & 0o077:
            raise IdentityFileError(f"{path} can be read by others (mode {mode:04o}): chmod 600, or enrol again")
        try:
            table = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise IdentityFileError(f"{path} is damaged: enrol the robot again") from error
        if not isinstance(table, dict):
            raise IdentityFileError(f"{path} is damaged: enrol the robot again")
        return table

    def _replace(self, name: str, table: dict[str, Any]) -> None:
        path = self.folder / name
        draft = path.with_suffix(".tmp")
        try:
            for folder in (self.folder.parent, self.folder):
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            draft.unlink(missing_ok=True)
            descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(descriptor, "w") as file:
                json.dump(table, file, indent=1)
                file.flush()
                os.fsync(file.fileno())
            draft.replace(path)
            if sys.platform != "win32":
                _sync(self.folder)
        except OSError as error:
            raise IdentityFileError(f"cannot write {path}: {error.strerror}") from error


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _sync(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
