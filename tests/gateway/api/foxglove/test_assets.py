"""The allow-list of files, against every way around it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gateway.api.foxglove.assets import read_asset
from gateway.api.foxglove.errors import AssetError
from metaros.limits import LIMITS
from tests.support.tables import refusal


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    inside = tmp_path / "assets"
    (inside / "arm" / "meshes").mkdir(parents=True)
    (inside / "arm" / "meshes" / "link.stl").write_bytes(b"solid")
    (inside / "map.png").write_bytes(b"png")
    (inside / "arm" / ".hidden.stl").write_bytes(b"secret")
    (inside / "arm" / "notes.txt").write_bytes(b"secret")
    (tmp_path / "outside.stl").write_bytes(b"secret")
    (inside / "way_out.stl").symlink_to(tmp_path / "outside.stl")
    (inside / "up").symlink_to(tmp_path)
    (inside / "inner.stl").symlink_to(inside / "arm" / "meshes" / "link.stl")
    return inside


def test_files_of_the_directory(folder: Path) -> None:
    assert read_asset(folder, "package://arm/meshes/link.stl") == b"solid"
    assert read_asset(folder, "asset:///map.png") == b"png"
    assert read_asset(folder, "asset:///inner.stl") == b"solid"  # a link that stays inside


REFUSED = (
    "package://arm/../../outside.stl",
    "package://../outside.stl",
    "package:///etc/passwd",
    "package://arm//meshes/link.stl",
    "package://arm/.hidden.stl",
    "package://arm/notes.txt",
    "package://arm/meshes/link.stl/",
    "package://arm/meshes/link.stl\0.png",
    "package://arm/meshes%2flink.stl",
    "package://arm\\meshes\\link.stl",
    "package://arm/meshes",
    "asset:///way_out.stl",
    "asset:///up/outside.stl",
    "file:///etc/hostname.stl",
    "https://example.org/a.stl",
    "arm/meshes/link.stl",
    "",
)


def test_everything_else_is_refused(folder: Path) -> None:
    assert [uri for uri in REFUSED if not refusal(AssetError, read_asset, folder, uri)] == []


def test_what_is_no_file_or_too_large_is_refused(folder: Path) -> None:
    with (folder / "huge.stl").open("wb") as file:
        file.truncate(LIMITS.asset_bytes + 1)
    with pytest.raises(AssetError, match=str(LIMITS.asset_bytes)):
        read_asset(folder, "asset:///huge.stl")
    os.mkfifo(folder / "pipe.stl")
    (folder / "folder.stl").mkdir()
    for name in ("pipe.stl", "folder.stl", "none.stl"):
        with pytest.raises(AssetError):
            read_asset(folder, f"asset:///{name}")
    with pytest.raises(AssetError, match="--assets-dir"):
        read_asset(None, "asset:///map.png")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(alphabet="./\\%~arm up outside.stl\0", max_size=30))
def test_no_uri_leads_out(folder: Path, tail: str) -> None:
    try:
        found = read_asset(folder, f"package://{tail}")
    except AssetError:
        return
    assert found != b"secret"
