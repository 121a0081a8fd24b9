"""What a directory and S3 have in common."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path

import numpy as np
import pytest

from gateway.errors import CorruptObjectError, ObjectMissingError
from gateway.store.objects import ObjectStore, check_objects_url, chunks, open_objects
from gateway.store.objects.store import check_name
from metaros.errors import ConfigError

LARGE = np.random.default_rng(6).bytes((8 << 20) * 2 + 12_345)  # three parts on S3


def put(objects: ObjectStore, name: str, data: bytes) -> None:
    """Keep some bytes."""
    objects.put(name, io.BytesIO(data), size_bytes=len(data), sha256=hashlib.sha256(data).hexdigest())


def test_what_was_put_is_read(objects: ObjectStore, tmp_path: Path) -> None:
    path = tmp_path / "source"
    path.write_bytes(LARGE)
    objects.put("a/large", path, size_bytes=len(LARGE), sha256=hashlib.sha256(LARGE).hexdigest())
    put(objects, "a/small", b"small")
    put(objects, "a/empty", b"")
    assert objects.read("a/small") == b"small"
    assert objects.read("a/empty") == b""
    assert hashlib.sha256(objects.read("a/large")).digest() == hashlib.sha256(LARGE).digest()
    assert b"".join(chunks(objects, "a/large", piece_bytes=5_000_000)) == LARGE
    listed = {info.name: info for info in objects.names()}
    assert {name: info.size_bytes for name, info in listed.items()} == {
        "a/empty": 0,
        "a/large": len(LARGE),
        "a/small": 5,
    }
    assert abs(listed["a/large"].modified_ns - path.stat().st_mtime_ns) < 600e9


def test_ranges(objects: ObjectStore) -> None:
    put(objects, "a", bytes(range(100)))
    assert objects.read("a", start=10, size_bytes=5) == bytes(range(10, 15))
    assert objects.read("a", start=90, size_bytes=50) == bytes(range(90, 100))
    assert objects.read("a", start=95) == bytes(range(95, 100))
    assert objects.read("a", start=100, size_bytes=1) == b""
    assert objects.read("a", start=1, size_bytes=0) == b""
    assert b"".join(chunks(objects, "a", start=7, size_bytes=50, piece_bytes=9)) == bytes(range(7, 57))
    assert [len(piece) for piece in chunks(objects, "a", piece_bytes=50)] == [50, 50]
    assert list(chunks(objects, "a", start=100)) == []


def test_a_name_is_taken_over_whole(objects: ObjectStore) -> None:
    put(objects, "a", b"first")
    put(objects, "a", b"the second")
    assert objects.read("a") == b"the second"


def test_what_is_not_there(objects: ObjectStore) -> None:
    with pytest.raises(ObjectMissingError, match="nothing/here"):
        objects.read("nothing/here")
    with pytest.raises(ObjectMissingError):
        next(chunks(objects, "nothing"))
    objects.delete("nothing/here")
    assert list(objects.names()) == []
    assert objects.sweep(before_ns=1 << 62) == 0


def test_deleted_is_gone(objects: ObjectStore) -> None:
    put(objects, "a/b", b"x")
    put(objects, "a/c", b"x")
    objects.delete("a/b")
    objects.delete("a/b")
    assert [info.name for info in objects.names()] == ["a/c"]
    with pytest.raises(ObjectMissingError):
        objects.read("a/b")


def test_names_by_prefix(objects: ObjectStore) -> None:
    names = ["a-x", "a.x", "a/1", "a/2/3", "a0", "b/1"]
    for name in reversed(names):
        put(objects, name, b"x")
    assert sorted(info.name for info in objects.names()) == names
    assert sorted(info.name for info in objects.names("a/")) == ["a/1", "a/2/3"]
    assert sorted(info.name for info in objects.names("a")) == names[:-1]


@pytest.mark.parametrize("size_bytes", [4, (8 << 20) + 4])
@pytest.mark.parametrize("wrong", ["longer", "shorter", "other"])
def test_other_bytes_than_promised_are_not_kept(objects: ObjectStore, size_bytes: int, wrong: str) -> None:
    data = LARGE[:size_bytes]
    source = {"longer": data + b"x", "shorter": data[:-1], "other": b"x" + data[1:]}[wrong]
    with pytest.raises(CorruptObjectError):
        objects.put("a", io.BytesIO(source), size_bytes=size_bytes, sha256=hashlib.sha256(data).hexdigest())
    assert list(objects.names()) == []
    assert objects.sweep(before_ns=1 << 62) == 0  # nothing was left half way either


@pytest.mark.parametrize("name", ["", "/a", "a/", "a//b", "../a", "a/../b", "a/..", ".a", "A", "a b", "ä", "a" * 256])
def test_names_that_no_store_takes(name: str) -> None:
    with pytest.raises(ConfigError):
        check_name(name)


def test_urls(tmp_path: Path) -> None:
    assert open_objects("", tmp_path).where == str(tmp_path / "objects")
    assert open_objects("file:///some%20where/else", tmp_path).where == "/some where/else"
    bucket = open_objects("s3://fleet/a/b/?endpoint=http://127.0.0.1:1&region=eu-west-1", tmp_path)
    assert bucket.where == "s3://fleet/a/b at http://127.0.0.1:1"
    bucket.close()
    for url in (
        "fleet",
        "http://fleet",
        "file://other/folder",
        "s3://",
        "s3://X",
        "s3://fleet?secret=1",
        "s3://fleet?endpoint=ftp://x",
        "s3://fleet?endpoint=http://user:secret@host",
    ):
        with pytest.raises(ConfigError):
            check_objects_url(url)
