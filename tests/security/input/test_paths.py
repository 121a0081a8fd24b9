"""Names from outside that would be paths: nothing outside its folder is read, written or listed."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

import httpx
import pytest
from starlette.applications import Starlette
from starlette.routing import Mount

from edge_agent.blackbox.recording_store import RecordingStore
from gateway.api.middleware.static import Dashboard
from gateway.domain.fleet.recording import is_recording_id
from gateway.domain.robot import is_robot_id
from gateway.errors import GatewayError, ObjectMissingError, ObjectRefusedError, ProtocolError
from gateway.ingest.handshake import check_hello
from gateway.store.objects.directory import DirectoryStore
from gateway.store.objects.s3 import S3Store
from gateway.store.objects.urls import BucketUrl
from metaros._proto import link_pb2
from metaros.errors import ConfigError, NameError_
from metaros.idl import names
from metaros.limits import LIMITS

SECRET = b"the secret of another folder"
X_SHA256 = "2d711642b726b04401627ca9fbac32f5c8530fb1903cc4db02258717921a4881"
_DOTS = (
    "..",
    "../",
    "..\\",
    "%2e%2e/",
    "%252e%252e/",
    "..%2f",
    "..%5c",
    "%2e%2e%2f",
    "..;/",
    "....//",
    "..././",
    ".%2e/",
)
_LOOKALIKES = (
    "\uff0e\uff0e/",
    "\u2024\u2024/",
    "..\u2215",
    "..\u2044",
    "..\uff0f",
    "..\uff3c",
    "\u2025/",
    "\u202e..",
    "\ufeff..",
)
_BROKEN = ("\xc0\xae\xc0\xae/", "..\0/", "..\n/", "..\r\n/", "..\t/", ".. /", "../ ", "..\x7f/")
_TARGETS = ("secret", "etc/passwd", "windows/win.ini", "x/../../secret", "secret.mcap")
_ABSOLUTE = (
    "/etc/passwd", "//etc/passwd", "\\\\host\\share", "C:\\secret", "C:secret", "file:///etc/passwd", "~", "~root/x",
    "/",
    "/proc/self/environ", "/dev/stdin", "//?/C:/secret", "\\\\.\\pipe\\x", "./../secret", "a/../../secret",
    "a/./../../secret",
    "a//../../secret", "a/b/../../../secret", "..", ".", "", " ", "  ", "\0", "a\0.mcap", "-", "--help", "-rf", "*",
    "?", "[a]",
)  # fmt: skip
_DEVICES = tuple(
    f"{device}{ending}"
    for device in ("CON", "PRN", "AUX", "NUL", "COM1", "LPT1", "CONIN$", "nul")
    for ending in ("", ".", ".mcap", ":", " ")
)
_ENDINGS = (
    "a.",
    "a..",
    "a ",
    "a. ",
    "a::$DATA",
    "a:stream",
    "a.partial",
    ".a",
    ".htaccess",
    ".git/config",
    "a/",
    "a\\",
    "a/.",
)
_LONG = ("a" * 256, "a" * 5000, "a/" * 2000, "../" * 500 + "secret", "\u00e9" * 200, "\U0001f916" * 100)
NAMES = tuple(
    dict.fromkeys(
        [
            *(dots + target for dots in (*_DOTS, *_LOOKALIKES, *_BROKEN) for target in _TARGETS),
            *_ABSOLUTE, *_DEVICES, *_ENDINGS, *_LONG,
        ]
    )
)  # fmt: skip


def test_there_are_enough_names() -> None:
    assert len(NAMES) >= 200


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A folder with a secret beside it, at every height that a name could climb to."""
    for folder in (tmp_path, tmp_path / "deep"):
        folder.mkdir(exist_ok=True)
        for name in ("secret", "secret.mcap", "passwd"):
            (folder / name).write_bytes(SECRET)
    inner = tmp_path / "deep" / "root"
    inner.mkdir()
    return inner


def tree(folder: Path) -> dict[str, bytes]:
    """Every file below, with what is in it."""
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_ids_and_names_are_refused() -> None:
    for name in NAMES:
        assert not is_recording_id(name), name
        if is_robot_id(name):  # it may look odd, and is one plain part of a path
            assert name not in (".", "..")
            assert not set(name) & set("/\\:%\0 ")
        hello = link_pb2.Hello(protocol=1, robot_id="r1", session_id=bytes(16), session_number=1, lane=1)
        hello.namespace = name
        try:
            names.validate_namespace(name)
        except NameError_:
            if name:  # left out, it is the root
                with pytest.raises(ProtocolError):
                    check_hello(hello, limits=LIMITS)
        else:
            assert not set(name) & set(".\\:%\0 "), name


def test_objects_stay_in_their_folder(root: Path, tmp_path: Path) -> None:
    store, before = DirectoryStore(root), tree(tmp_path)
    for name in NAMES:
        for attempt in (name, f"recordings/{name}", f"{name}/x"):
            try:
                found = store.read(attempt)
            except (GatewayError, ConfigError):
                found = b""
            assert SECRET not in found
            with pytest.raises((GatewayError, ConfigError)):
                store.put(attempt, io.BytesIO(b"x"), size_bytes=1, sha256="0" * 64)
            try:
                store.delete(attempt)
            except (GatewayError, ConfigError):
                continue
    assert tree(tmp_path) == before


def test_keys_of_a_bucket_stay_below_their_prefix() -> None:
    store = S3Store(BucketUrl("bucket", "mine", "http://127.0.0.1:1", "r"))
    for name in NAMES:
        try:
            key = store._key(name)
        except ConfigError:
            continue
        assert key.startswith("mine/")
        assert ".." not in key
    store.close()


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_link_in_the_way_of_an_object_is_not_followed(root: Path, tmp_path: Path) -> None:
    store = DirectoryStore(root)
    (root / "file").symlink_to(tmp_path / "secret")
    (root / "folder").symlink_to(tmp_path)
    os.link(tmp_path / "secret", root / "hard")  # of the same owner: nothing tells it from a file of ours
    for name in ("file", "folder/secret"):
        with pytest.raises(GatewayError):
            store.read(name)
    with pytest.raises(ObjectRefusedError):
        store.put(
            "folder/new",
            io.BytesIO(b"x"),
            size_bytes=1,
            sha256=X_SHA256,
        )
    store.put(
        "file",
        io.BytesIO(b"x"),
        size_bytes=1,
        sha256=X_SHA256,
    )
    assert (tmp_path / "secret").read_bytes() == SECRET  # the link was replaced, not what it names
    assert not (tmp_path / "new").exists()
    store.delete("folder-that-is-not")
    assert [item.name for item in store.names()] == ["file", "hard"]


def written(name: str) -> str:
    """The name in an address: what may stand there as it is, the rest in percent."""
    kept = b"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789/.%:;~*-"
    return "".join(chr(byte) if byte in kept else f"%{byte:02x}" for byte in name.encode())


async def test_the_dashboard_serves_nothing_but_its_files(root: Path) -> None:
    (root / "index.html").write_text("the page")
    (root / "assets").mkdir()
    (root / "assets" / "a.js").write_text("a script")
    if sys.platform != "win32":
        (root / "assets" / "link.js").symlink_to(root.parent / "secret")
    app = Starlette(routes=[Mount("/", Dashboard(root))])
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://gateway") as client:
        for name in NAMES:
            for place in (f"/{written(name)[:2000]}", f"/assets/{written(name)[:2000]}"):
                answer = await client.get(f"http://gateway{place}")
                assert answer.text in ("the page", "Not Found", "Method Not Allowed"), place
        assert (await client.get("/assets/a.js")).text == "a script"
        assert (await client.get("/assets/link.js")).status_code == 404


def test_recordings_that_wait_are_found_by_their_ids_alone(root: Path, tmp_path: Path) -> None:
    before = tree(tmp_path)
    shelf = RecordingStore(root)
    for name in NAMES:
        assert shelf.get(name) is None
        shelf.remove(name)
    after = tree(tmp_path)
    assert {name: data for name, data in after.items() if data == SECRET} == before


def test_a_missing_object_is_missing(root: Path) -> None:
    with pytest.raises(ObjectMissingError):
        DirectoryStore(root).read("recordings/a.mcap")
