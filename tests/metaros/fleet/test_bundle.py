"""Bundles: what is one, and everything that looks like one and is none."""

from __future__ import annotations

import contextlib
import io
import stat
import struct
import tracemalloc
import zipfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from metaros.fleet.bundle import BundleError, read_bundle, target_path, version_key
from tests.support.deployment.bundles import WHEEL, make_bundle


def test_a_bundle_says_what_it_is(tmp_path: Path) -> None:
    path = make_bundle(tmp_path, version="1.2.0", extra='min_version = "1.1.0"\nhw = ["aarch64"]\npython = ">=3.11"\n')
    read = read_bundle(path)
    assert (read.name, read.kind, read.version, read.min_version) == ("lidar-node", "node", "1.2.0", "1.1.0")
    assert (read.hw, read.python, read.entry) == (("aarch64",), ">=3.11", "lidar_node.main:main")
    assert read.path == "nodes/lidar-node/1.2.0.zip"
    assert read.custom["min_version"] == "1.1.0"


def test_versions_are_compared_as_numbers() -> None:
    assert version_key("1.10.0") > version_key("1.9.9")
    assert version_key("1.2") == version_key("1.2.0.0")
    for text in ("1", "1.2.3.4.5", "01.2", "1.2-rc1", "v1.2", "1.2\n", "", "1.-2", "１.2"):
        with pytest.raises(BundleError):
            version_key(text)


def test_a_group_has_paths_of_its_own() -> None:
    assert target_path("agent", "metaros", "2.0.0", group="field") == "robots/field/agents/metaros/2.0.0.zip"
    for group in ("..", "a/b", "A"):
        with pytest.raises(BundleError):
            target_path("agent", "metaros", "2.0.0", group=group)


IMAGE = 'format = 1\nname = "lidar-node"\nkind = "node"\nversion = "1.0.0"\nimage = "files/a.tar"\n'


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"manifest": "format = 2"}, "format"),
        ({"manifest": "name = 1"}, "format"),
        ({"manifest": "format = 1\nname = 1"}, "name"),
        ({"manifest": "\xff\xfe = ["}, "cannot be read"),
        ({"extra": "surprise = 1\n"}, "surprise"),
        ({"extra": 'min_version = "9.0"\n'}, "min_version"),
        ({"extra": 'python = "3"\n'}, "python"),
        ({"extra": 'hw = ["a b"]\n'}, "hw"),
        ({"extra": 'command = ["files/run"]\nentry = "a:b"\n'}, "one of entry, command and image"),
        ({"extra": 'command = ["files/run"]\n', "members": {}}, "not in the bundle"),
        ({"extra": 'image = "files/image.tar"\n', "members": {"files/image.tar": b""}}, "one of entry"),
        ({"extra": 'command = ["files/run"]\nimage = "files/image.tar"\n', "members": {}}, "one of entry"),
        ({"extra": 'image = "docker.io/lidar"\n'}, "image"),
        ({"manifest": IMAGE}, "no 'files/a.tar' in the bundle"),
        ({"kind": "agent", "name": "metaros", "extra": 'image = "files/image.tar"\n'}, "nor image"),
        ({"members": {}}, "wheel"),
        ({"name": "metaros"}, "the agent's bundles"),
        ({"kind": "agent"}, "the agent's bundles"),
        ({"kind": "tool"}, "node or agent"),
        ({"name": "../up"}, "kind and name"),
        ({"members": {WHEEL: b"", "../../etc/passwd": b"x"}}, "passwd"),
        ({"members": {WHEEL: b"", "/etc/passwd": b"x"}}, "passwd"),
        ({"members": {WHEEL: b"", "files/../../x": b"x"}}, "files/../../x"),
        ({"members": {WHEEL: b"", "files/..": b"x"}}, "files/.."),
        ({"members": {WHEEL: b"", "setup.py": b"x"}}, "setup.py"),
        ({"members": {WHEEL: b"", "files\\x": b"x"}}, "and not"),
        ({"members": {WHEEL: b"", "wheels/LIDAR_node-1.0.0-py3-none-any.whl": b""}}, "twice"),
        ({"members": {WHEEL: b"\0" * 1_000_000}}, "grows"),
        ({"members": {f"files/{n}": b"" for n in range(513)}}, "members"),
    ],
)
def test_what_is_no_bundle(tmp_path: Path, said: dict[str, object], message: str) -> None:
    path = make_bundle(tmp_path, **said)  # type: ignore[arg-type]
    with pytest.raises(BundleError, match=message):
        read_bundle(path)


def test_a_directory_of_millions_is_never_taken_in() -> None:
    """zipfile makes an object of each member before anybody can count them: 4 GB of memory for a file of 256 MiB."""
    member = struct.pack("<I6H3I5H2I", 0x02014B50, 20, 20, 0, 0, 0, 33, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0) + b"files/a"
    directory = member * 300_000
    file = io.BytesIO(directory + struct.pack("<I4H2IH", 0x06054B50, 0, 0, 512, 512, len(directory), 0, 0))
    tracemalloc.start()
    try:
        with pytest.raises(BundleError, match="directory"):
            read_bundle(file)
        assert tracemalloc.get_traced_memory()[1] < 4 << 20
    finally:
        tracemalloc.stop()


def test_a_link_in_a_bundle_is_refused(tmp_path: Path) -> None:
    path = make_bundle(tmp_path)
    with zipfile.ZipFile(path, "a") as archive:
        link = zipfile.ZipInfo("files/link")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(BundleError, match="no regular file"):
        read_bundle(path)


def test_a_member_that_is_not_packed_by_deflate_is_refused(tmp_path: Path) -> None:
    path = make_bundle(tmp_path)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("files/a", b"x", compress_type=zipfile.ZIP_BZIP2)
    with pytest.raises(BundleError, match="'files/a' is packed otherwise than by deflate"):
        read_bundle(path)


def test_a_member_whose_checksum_does_not_hold(tmp_path: Path) -> None:
    path = make_bundle(tmp_path, members={WHEEL: b"wheel " * 10})
    data = bytearray(path.read_bytes())
    at = data.index(b"PK\x01\x02")  # the first entry of the directory, bundle.toml's: its checksum is 16 bytes on
    second = data.index(b"PK\x01\x02", at + 1)
    data[second + 16] ^= 1
    path.write_bytes(data)
    with pytest.raises(BundleError):
        read_bundle(path)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.integers(0, 10_000), value=st.integers(0, 255), cut=st.integers(0, 400))
def test_damaged_bundles_raise_nothing_else(tmp_path: Path, at: int, value: int, cut: int) -> None:
    path = make_bundle(tmp_path, members={WHEEL: b"0123456789" * 20})
    data = bytearray(path.read_bytes())
    data[at % len(data)] = value
    path.write_bytes(data[: max(0, len(data) - cut)] if cut > 200 else data)
    with contextlib.suppress(BundleError):
        read_bundle(path)
