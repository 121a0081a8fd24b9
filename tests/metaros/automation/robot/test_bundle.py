"""A function's package as a bundle: the gateway's own zip file, a program of the robot's, and nothing else."""

from __future__ import annotations

import zipfile
from importlib import import_module
from pathlib import Path

import pytest

from metaros.automation.functions.package import check_zip
from metaros.automation.robot.bundle import main, make_bundle, pack_function
from metaros.automation.robot.program import bundled
from metaros.errors import ConfigError, PackageError
from metaros.fleet.bundle import BundleError, read_bundle
from tests.support.functions.robot_function import function_zip, write_function


def test_a_folder_is_always_packed_into_the_same_bytes(tmp_path: Path) -> None:
    one, other = (write_function(tmp_path / name) for name in ("one", "other"))
    (one / "__pycache__").mkdir()
    (one / "__pycache__" / "app.pyc").write_bytes(b"of another Python")
    data = pack_function(one)
    assert data == pack_function(other)
    assert check_zip(data).names == ("app.py", "function.yaml")


def test_a_zip_file_goes_in_as_it_is(tmp_path: Path) -> None:
    data = function_zip(write_function(tmp_path / "echo"))
    made = make_bundle(tmp_path / "echo.zip", tmp_path / "bundle.zip", version="1.2.0")
    manifest = read_bundle(made)
    assert (manifest.name, manifest.kind, manifest.version) == ("echo", "node", "1.2.0")
    assert manifest.entry == "metaros.robot_functions.program:bundled"  # for ever: bundles are signed, and kept
    module, _, function = manifest.entry.partition(":")
    assert getattr(import_module(module), function) is bundled
    with zipfile.ZipFile(made) as archive:
        assert archive.read("files/function.zip") == data


def test_what_is_no_function_makes_no_bundle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "bundle.zip"
    (tmp_path / "empty").mkdir()
    with pytest.raises(PackageError):
        make_bundle(tmp_path / "empty", target, version="1.0.0")
    (tmp_path / "plain").mkdir()
    (tmp_path / "plain" / "app.py").write_text("")
    with pytest.raises(ConfigError, match=r"no function\.yaml"):
        make_bundle(tmp_path / "plain", target, version="1.0.0")
    with pytest.raises(BundleError, match="version"):
        make_bundle(write_function(tmp_path / "echo"), target, version="new")
    assert not target.exists()
    assert main([str(tmp_path / "nowhere"), "--version", "1.0.0", "--out", str(target)]) == 1
    assert "nowhere" in capsys.readouterr().err


def test_an_entry_of_somebody_elses_needs_a_wheel_still(tmp_path: Path) -> None:
    path = tmp_path / "bundle.zip"
    said = 'format = 1\nname = "echo"\nkind = "node"\nversion = "1.0.0"\nentry = "metarosx.program:main"\n'
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("bundle.toml", said)
    with pytest.raises(BundleError, match="wheel"):
        read_bundle(path)
