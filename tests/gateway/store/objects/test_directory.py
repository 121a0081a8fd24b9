"""What only a directory has: files, links, partial files, full disks."""

from __future__ import annotations

import hashlib
import io
import os
from pathlib import Path

import pytest

from gateway.errors import ObjectRefusedError, ObjectStoreError
from gateway.store.objects import DirectoryStore


def put(objects: DirectoryStore, name: str, data: bytes) -> None:
    """Keep some bytes."""
    objects.put(name, io.BytesIO(data), size_bytes=len(data), sha256=hashlib.sha256(data).hexdigest())


def test_an_object_is_a_file_that_only_its_owner_reads(tmp_path: Path) -> None:
    objects = DirectoryStore(tmp_path / "not" / "there")
    put(objects, "segments/1/a.mcap", b"bytes")
    path = tmp_path / "not" / "there" / "segments" / "1" / "a.mcap"
    assert path.read_bytes() == b"bytes"
    assert path.stat().st_mode & 0o077 == 0
    assert [file.name for file in path.parent.iterdir()] == ["a.mcap"]


def test_links_are_not_followed(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "secret").write_bytes(b"secret")
    root = tmp_path / "objects"
    root.mkdir()
    (root / "folder").symlink_to(outside)
    (root / "file").symlink_to(outside / "secret")
    objects = DirectoryStore(root)
    with pytest.raises(ObjectRefusedError):
        objects.read("folder/secret")
    with pytest.raises(ObjectRefusedError):
        put(objects, "folder/new", b"x")
    with pytest.raises(ObjectStoreError):
        objects.read("file")
    assert list(objects.names()) == []
    put(objects, "file", b"own")  # the name is taken, what it led to stays
    assert (outside / "secret").read_bytes() == b"secret"
    assert objects.read("file") == b"own"


def test_what_a_crash_left_is_swept_once_it_is_old(tmp_path: Path) -> None:
    objects = DirectoryStore(tmp_path)
    put(objects, "a/b", b"kept")
    for name, age_ns in ((".b.0000.partial", 5), (".b.0001.partial", 50)):
        (tmp_path / "a" / name).write_bytes(b"half")
        os.utime(tmp_path / "a" / name, ns=(age_ns, age_ns))
    assert [info.name for info in objects.names()] == ["a/b"]
    assert objects.sweep(before_ns=20) == 1
    assert sorted(file.name for file in (tmp_path / "a").iterdir()) == [".b.0001.partial", "b"]


def test_a_source_that_breaks_leaves_nothing(tmp_path: Path) -> None:
    class Broken(io.BytesIO):
        """Fails half way."""

        def read(self, size: int | None = -1, /) -> bytes:
            """Half of it, then an error."""
            if self.tell():
                raise OSError(5, "Input/output error")
            return super().read(3)

    objects = DirectoryStore(tmp_path / "objects")
    with pytest.raises(ObjectStoreError, match="Input/output"):
        objects.put("a/b", Broken(b"abcdef"), size_bytes=6, sha256=hashlib.sha256(b"abcdef").hexdigest())
    assert list((tmp_path / "objects").rglob("*.*")) == []


def test_a_file_in_the_way_is_an_error_of_the_store(tmp_path: Path) -> None:
    (tmp_path / "objects").write_bytes(b"")
    objects = DirectoryStore(tmp_path / "objects")
    with pytest.raises(ObjectStoreError):
        put(objects, "a/b", b"x")
