"""A signed repository in memory and the server that gives it out: as it is, or as an attacker would."""

from __future__ import annotations

import base64
import hashlib
import io
import ssl
import threading
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from securesystemslib.signer import CryptoSigner
from tuf.api.metadata import (
    DelegatedRole,
    Delegations,
    Metadata,
    MetaFile,
    Root,
    Snapshot,
    TargetFile,
    Targets,
    Timestamp,
)

from metaros.fleet.bundle import Manifest
from tests.support.deployment.zips import member

__all__ = ["Served", "TufRepository", "make_bundle", "make_wheel", "serve", "target_file"]

PREFIX = "/api/v1/updates/"
Fault = Callable[[BaseHTTPRequestHandler, bytes], None]


def make_wheel(name: str, version: str, modules: dict[str, str]) -> tuple[str, bytes]:
    """A pure wheel, made by hand: its file name and bytes."""
    folder = f"{name}-{version}.dist-info"
    files = {path: text.encode() for path, text in modules.items()}
    files[f"{folder}/METADATA"] = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n".encode()
    files[f"{folder}/WHEEL"] = b"Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    rows = [
        f"{path},sha256={base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b'=').decode()},{len(data)}"
        for path, data in files.items()
    ]
    files[f"{folder}/RECORD"] = "\n".join([*rows, f"{folder}/RECORD,,", ""]).encode()
    return f"{name}-{version}-py3-none-any.whl", zipped(files)


def zipped(files: dict[str, bytes]) -> bytes:
    """A zip of these files."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(member(name), data)
    return buffer.getvalue()


def make_bundle(
    version: str,
    *,
    name: str = "metaros",
    kind: str = "agent",
    wheels: dict[str, bytes] | None = None,
    more: dict[str, bytes] | None = None,
    **rows: Any,
) -> bytes:
    """A bundle; `rows` go into its bundle.toml."""
    table = {"format": 1, "name": name, "kind": kind, "version": version, **rows}
    text = "".join(
        f"{key} = {value if isinstance(value, (int, list)) else repr(value)}\n" for key, value in table.items()
    )
    if wheels is None:
        wheels = dict([make_wheel("placeholder", "1.0", {"placeholder.py": ""})])
    files = {
        "bundle.toml": text.encode(),
        **{f"wheels/{wheel}": data for wheel, data in wheels.items()},
        **(more or {}),
    }
    return zipped(files)


def target_file(path: str, data: bytes, custom: dict[str, Any] | None = None) -> TargetFile:
    """What is signed of a target."""
    file = TargetFile.from_data(path, data, ["sha256"])
    if custom is not None:
        file.unrecognized_fields["custom"] = custom
    return file


class TufRepository:
    """Root by two of three keys; targets, snapshot and timestamp by one each. `publish` signs what has changed."""

    def __init__(self, now: datetime) -> None:
        self.files: dict[str, bytes] = {}
        self.now = now
        self.root_keys = [CryptoSigner.generate_ed25519() for _ in range(3)]
        self.keys = {role: CryptoSigner.generate_ed25519() for role in ("timestamp", "snapshot", "targets")}
        self.root = Metadata(Root(version=1, expires=self.after(365), consistent_snapshot=True))
        self.targets = Metadata(Targets(expires=self.after(90)))
        self.snapshot = Metadata(Snapshot(expires=self.after(7)))
        self.timestamp = Metadata(Timestamp(expires=self.after(1)))
        for role in (self.targets, self.snapshot, self.timestamp):
            role.signed.version = 0  # publish counts it
        self.delegated: dict[str, tuple[Metadata[Targets], CryptoSigner]] = {}
        self._trust()
        self.sign_root(self.root_keys)

    def after(self, days: float) -> datetime:
        """A time from now."""
        return (self.now + timedelta(days=days)).replace(microsecond=0)

    def _trust(self) -> None:
        root = self.root.signed
        for key in self.root_keys:
            root.add_key(key.public_key, "root")
        root.roles["root"].threshold = 2
        for role, key in self.keys.items():
            root.add_key(key.public_key, role)

    def sign_root(self, signers: list[CryptoSigner]) -> None:
        """Put the root out under its version, signed by these."""
        self.root.signatures.clear()
        for signer in signers:
            self.root.sign(signer, append=True)
        self.files[f"metadata/{self.root.signed.version}.root.json"] = self.root.to_bytes()

    def next_root(self) -> Root:
        """The root with the next version, to be changed and signed."""
        self.root.signed.version += 1
        return self.root.signed

    def replace_key(self, role: str) -> CryptoSigner:
        """Another key for a role, in the root to be signed."""
        root, old = self.root.signed, self.keys[role]
        root.revoke_key(old.public_key.keyid, role)
        self.keys[role] = CryptoSigner.generate_ed25519()
        root.add_key(self.keys[role].public_key, role)
        return old

    def add(self, path: str, data: bytes, custom: dict[str, Any] | None = None) -> TargetFile:
        """A target of the top role; not signed yet."""
        file = self.targets.signed.targets[path] = target_file(path, data, custom)
        self.put(path, data)
        return file

    def put(self, path: str, data: bytes, digest: str = "") -> None:
        """The bytes of a target, where a robot looks for them."""
        folder, _, name = path.rpartition("/")
        self.files[f"targets/{folder}/{digest or hashlib.sha256(data).hexdigest()}.{name}"] = data

    def add_agent(self, version: str, **rows: Any) -> bytes:
        """A bundle of the agent, as the gateway publishes it."""
        data = make_bundle(version, **rows)
        keys = {key: value for key, value in rows.items() if key in ("min_version", "hw", "python")}
        custom = Manifest(name="metaros", kind="agent", version=version, **keys).custom
        self.add(f"agents/metaros/{version}.zip", data, custom)
        return data

    def delegate(self, role: str, patterns: list[str]) -> Targets:
        """A role that may sign targets of these names."""
        key = CryptoSigner.generate_ed25519()
        if self.targets.signed.delegations is None:
            self.targets.signed.delegations = Delegations({}, {})
        found = self.targets.signed.delegations
        assert found.roles is not None
        found.roles[role] = DelegatedRole(role, [], 1, False, paths=patterns)
        self.targets.signed.add_key(key.public_key, role)
        metadata = Metadata(Targets(expires=self.after(90)))
        metadata.signed.version = 0
        self.delegated[role] = (metadata, key)
        return metadata.signed

    def publish(self) -> None:
        """The next version of everything below the root."""
        for role, (metadata, key) in self.delegated.items():
            metadata.signed.version += 1
            metadata.sign(key)
            self.files[f"metadata/{metadata.signed.version}.{role.replace('/', '%2F')}.json"] = metadata.to_bytes()
            self.snapshot.signed.meta[f"{role}.json"] = MetaFile(metadata.signed.version)
        self.targets.signed.version += 1
        self.sign("targets")
        self.publish_snapshot()

    def publish_snapshot(self) -> None:
        """The next snapshot of the targets as they are, and a timestamp."""
        self.snapshot.signed.meta["targets.json"] = MetaFile(self.targets.signed.version)
        self.snapshot.signed.version += 1
        data = self.sign("snapshot")
        self.publish_timestamp(data)

    def publish_timestamp(self, snapshot: bytes) -> None:
        """The next timestamp of the snapshot as it is."""
        meta = MetaFile.from_data(self.snapshot.signed.version, snapshot, ["sha256"])
        self.timestamp.signed.snapshot_meta = meta
        self.timestamp.signed.version += 1
        self.timestamp.signed.expires = self.after(1)
        self.sign("timestamp")

    def sign(self, role: str, signer: CryptoSigner | None = None) -> bytes:
        """Sign a role's file and put it out."""
        metadata: Metadata[Any] = getattr(self, role)
        metadata.sign(signer or self.keys[role])
        name = "timestamp.json" if role == "timestamp" else f"{metadata.signed.version}.{role}.json"
        data = self.files[f"metadata/{name}"] = metadata.to_bytes()
        return data


class Served:
    """The server: set `faults[path]` to misbehave there; `asked` are paths and Range headers."""

    def __init__(self, repository: TufRepository) -> None:
        self.repository = repository
        self.faults: dict[str, Fault] = {}
        self.asked: list[tuple[str, str]] = []
        self.token = ""
        self.url = ""
        self.ending = threading.Event()

    def misbehave(self, end_of_path: str, fault: Fault) -> None:
        """From now on at every path that ends like this."""
        self.faults[end_of_path] = fault

    def answer(self, handler: BaseHTTPRequestHandler) -> None:
        """One request."""
        span = handler.headers.get("Range", "")
        self.asked.append((handler.path.removeprefix(PREFIX), span))
        data = self.repository.files.get(handler.path.removeprefix(PREFIX))
        if self.token and handler.headers.get("Authorization") != f"Bearer {self.token}":
            plain(handler, b"", status=401)
            return
        for end, fault in self.faults.items():
            if handler.path.endswith(end):
                fault(handler, data or b"")
                return
        if data is None:
            plain(handler, b"", status=404)
        elif span:
            start = int(span.removeprefix("bytes=").removesuffix("-"))
            plain(
                handler, data[start:], status=206, more={"Content-Range": f"bytes {start}-{len(data) - 1}/{len(data)}"}
            )
        else:
            plain(handler, data)


def plain(
    handler: BaseHTTPRequestHandler,
    data: bytes,
    *,
    status: int = 200,
    more: dict[str, str] | None = None,
    size: int = -1,
) -> None:
    """An answer; `size` is what it claims, if that is not the truth."""
    handler.send_response(status)
    handler.send_header("Content-Length", str(len(data) if size < 0 else size))
    for name, value in (more or {}).items():
        handler.send_header(name, value)
    handler.end_headers()
    handler.wfile.write(data)


@contextmanager
def serve(repository: TufRepository, *, tls: ssl.SSLContext | None = None) -> Iterator[Served]:
    """The repository on this machine."""
    served = Served(repository)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            with suppress(OSError):  # the robot had enough
                served.answer(self)
            self.close_connection = True

        def log_request(self, *_args: object) -> None:
            pass

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *_args: object) -> None:
            pass

    server = Server(("127.0.0.1", 0), Handler)
    served.url = f"{'http' if tls is None else 'https'}://127.0.0.1:{server.server_address[1]}"
    if tls is not None:
        server.socket = tls.wrap_socket(server.socket, server_side=True, do_handshake_on_connect=False)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield served
    finally:
        served.ending.set()
        server.shutdown()
        thread.join()
        server.server_close()


def utc(ns: int) -> datetime:
    """Nanoseconds since 1970 as tuf wants them."""
    return datetime.fromtimestamp(ns // 1_000_000_000, UTC)
