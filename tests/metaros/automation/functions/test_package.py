"""Zip files of code: what is taken, what is refused and why, and how it lies on the disk."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import io
import os
import stat
import struct
import zipfile
from pathlib import Path

import pytest

from metaros.automation.functions.package import check_zip, discard, unpack
from metaros.errors import PackageError
from metaros.limits import LIMITS
from tests.support.tables import cases

SMALL = dataclasses.replace(
    LIMITS, function_zip_bytes=100_000, function_unpacked_bytes=1_000_000, function_files=10, function_path_chars=40
)


def packed(*members: tuple[str | zipfile.ZipInfo, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip file of these members."""
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", method) as archive:
        for name, data in members:
            archive.writestr(name, data, compress_type=method)
    return held.getvalue()


def linked(name: str, kind: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.create_system, info.external_attr = 3, (kind | 0o777) << 16
    return info


def test_the_facts_of_a_package() -> None:
    data = packed(("app.py", b"x = 1\n"), ("lib/", b""), ("lib/more.py", b"y"))
    facts = check_zip(data)
    assert facts.names == ("app.py", "lib/more.py")
    assert (facts.files, facts.unpacked_bytes, facts.size_bytes) == (2, 7, len(data))
    assert facts.sha256 == hashlib.sha256(data).hexdigest()
    assert facts.code_sha256 == base64.b64encode(hashlib.sha256(data).digest()).decode()


@cases(
    ("name", "said"),
    [
        ("../evil.py", "lead nowhere else"),
        ("a/../../evil.py", "lead nowhere else"),
        ("/etc/passwd", "lead nowhere else"),
        ("a//b.py", "lead nowhere else"),
        ("./a.py", "lead nowhere else"),
        ("C:/evil.py", "lead nowhere else"),
        ("a\\..\\evil.py", "lead nowhere else"),
        ("a\nb.py", "control characters"),
        ("x" * 41, "at most 40"),
    ],
)
def test_names_that_lead_remote_are_refused(name: str, said: str) -> None:
    with pytest.raises(PackageError, match=said):
        check_zip(packed(("app.py", b""), (name, b"x")), limits=SMALL)


def test_a_name_behind_a_nul_is_seen() -> None:
    data = packed(("app.pyX.txt", b"x")).replace(b"app.pyX", b"app.py\0")
    with pytest.raises(PackageError, match="control characters"):
        check_zip(data)


@cases("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFSOCK])
def test_links_and_devices_are_refused(kind: int) -> None:
    with pytest.raises(PackageError, match="links and devices"):
        check_zip(packed((linked("link", kind), b"/etc/shadow")))


def test_a_name_comes_once_and_is_one_thing() -> None:
    with pytest.warns(UserWarning, match="Duplicate"):
        twice = packed(("a.py", b"1"), ("a.py", b"2"))
    with pytest.raises(PackageError, match="twice"):
        check_zip(twice)
    with pytest.raises(PackageError, match="a file and a folder"):
        check_zip(packed(("a", b"1"), ("a/b.py", b"2")))


def test_bounds_in_bytes_and_members() -> None:
    with pytest.raises(PackageError, match="at most 100000"):
        check_zip(packed(("a", os.urandom(100_001))), limits=SMALL)
    with pytest.raises(PackageError, match="unpacked it has 1000001 bytes, at most 1000000"):
        check_zip(packed(("a", bytes(600_000)), ("b", bytes(400_001))), limits=SMALL)
    with pytest.raises(PackageError, match="more than 10 files"):
        check_zip(packed(*((f"f{i}", b"") for i in range(11))), limits=SMALL)
    assert check_zip(packed(*((f"f{i}", b"") for i in range(10))), limits=SMALL).files == 10


@pytest.mark.parametrize(
    "data",
    [b"", b"PK", b"not a zip file at all", bytes(100), packed(("a", b"1"))[:-8]],
    ids=["empty", "begun", "text", "zeros", "cut"],  # a zip file has the time in it, and names are the same everywhere
)
def test_what_is_no_zip_file_is_refused(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "code.zip").write_bytes(data)
    for source in (data, tmp_path / "code.zip"):
        with pytest.raises(PackageError, match=r"no zip file|empty"):
            check_zip(source)


def test_an_empty_package_is_refused() -> None:
    for data in (packed(), packed(("only/", b""))):
        with pytest.raises(PackageError, match="empty"):
            check_zip(data)


def test_encrypted_and_rarely_packed_members_are_refused() -> None:
    data = bytearray(packed(("a.py", b"1")))
    data[data.index(b"PK\x01\x02") + 8] |= 1
    with pytest.raises(PackageError, match="encrypted"):
        check_zip(bytes(data))
    with pytest.raises(PackageError, match="method 14"):
        check_zip(packed(("a.py", b"1"), method=zipfile.ZIP_LZMA))


def test_unpacked_it_is_for_all_to_read_and_none_to_write(tmp_path: Path) -> None:
    tool = linked("bin/tool", stat.S_IFREG)
    (tmp_path / "code.zip").write_bytes(packed(("app.py", b"x = 1\n"), (tool, b"#!/bin/sh\n"), ("deep/er/", b"")))
    before = os.umask(0o077)
    try:
        folder = unpack(tmp_path / "code.zip", tmp_path / "codes")
    finally:
        os.umask(before)
    assert folder.name == check_zip(tmp_path / "code.zip").sha256
    modes = {str(p.relative_to(folder)): stat.S_IMODE(p.stat().st_mode) for p in [folder, *folder.rglob("*")]}
    assert modes == {".": 0o555, "app.py": 0o444, "bin": 0o555, "bin/tool": 0o555, "deep": 0o555, "deep/er": 0o555}
    assert [p.name for p in (tmp_path / "codes").iterdir()] == [folder.name]
    stamp = folder.stat().st_mtime_ns
    assert unpack(tmp_path / "code.zip", tmp_path / "codes").stat().st_mtime_ns == stamp
    discard(folder)
    assert list((tmp_path / "codes").iterdir()) == []


def lying(size: int) -> bytes:
    """A member that unpacks to 500,000 bytes and is said to have `size`."""
    data = packed(("bomb", bytes(500_000)))
    central = data.index(b"PK\x01\x02")
    return data[: central + 24] + struct.pack("<I", size) + data[central + 28 :]


@pytest.mark.parametrize("data", [lying(1000), lying(600_000)])
def test_real_sizes_count_and_nothing_is_left_behind(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "code.zip").write_bytes(data)
    with pytest.raises(PackageError, match="bomb"):
        unpack(tmp_path / "code.zip", tmp_path / "codes")
    assert list((tmp_path / "codes").iterdir()) == []


def test_a_damaged_member_is_refused_and_nothing_is_left_behind(tmp_path: Path) -> None:
    data = packed(("a.py", b"some text that is here"), method=zipfile.ZIP_STORED)
    (tmp_path / "code.zip").write_bytes(data.replace(b"text", b"tExt"))
    with pytest.raises(PackageError, match=r"a\.py' is damaged"):
        unpack(tmp_path / "code.zip", tmp_path / "codes")
    assert list((tmp_path / "codes").iterdir()) == []
