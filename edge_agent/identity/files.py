"""The robot's identity on its disk: one file, replaced as a whole, so that key and certificate always belong together.

`identity/identity.json` is what holds. `identity/pending.json` is a key for which a certificate was asked and not yet
received: the answer may be lost, and the gateway gives it again for the same key alone. Both have mode 0600.
"""

from __future__ import annotations

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

IDENTITY, PENDING = "identity.json", "pending.json"
FILE_BYTES = 256 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotIdentity:
    """What an enrolled robot has. All certificates and the key are PEM texts."""

    robot: str
    fleet: str
    url: str  # of the gateway's HTTP door, where the certificate is renewed
    system_trust: bool  # whether that door's TLS is vouched for by this system's authorities, not by the fleet's root
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

    def save(self, identity: RobotIdentity) -> None:
        """Put it in the place of what held, on the disk before this returns; what was pending is done."""
        self._replace(IDENTITY, asdict(identity))
        self.forget_pending()

    def pending_key(self, purpose: str) -> PrivateKey:
        """The key to ask a certificate for: the one of an earlier attempt with the same purpose, else a new one.

        `purpose` is the token's id, or the certificate that is to be renewed.
        """
        table = self._read(PENDING)
        if table is not None and table.get("purpose") == purpose and isinstance(table.get("key"), str):
            return key_from_pem(table["key"])
        key = new_key()
        self._replace(PENDING, {"purpose": purpose, "key": key_to_pem(key)})
        return key

    def forget_pending(self) -> None:
        """No answer is waited for any more."""
        try:
            (self.folder / PENDING).unlink(missing_ok=True)
        except OSError as error:
            raise IdentityFileError(f"cannot delete {self.folder / PENDING}: {error.strerror}") from error

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
        except ValueError as error:
            raise IdentityFileError(f"{path} is damaged: enrol the robot again") from error
        if not isinstance(table, dict):
            raise IdentityFileError(f"{path} is damaged: enrol the robot again")
        return table

    def _replace(self, name: str, table: dict[str, Any]) -> None:
        path = self.folder / name
        draft = path.with_suffix(".tmp")
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
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


def _sync(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
