"""Every kind there is, as people and tables meet it; and kinds of one's own."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

from metaros.drivers.probing import Found
from metaros.drivers.registry import FOLDER, device_maker, driver_kinds, maker_in, manifest_of, probe, prober
from metaros.drivers.scaffold import scaffold
from metaros.drivers.values import read_values
from metaros.errors import ConfigError
from metaros.idl import message_class

KINDS = driver_kinds()
ROOT = Path(__file__).resolve().parents[3]


def test_each_folder_of_a_driver_is_a_kind() -> None:
    assert set(KINDS) == {path.parent.name for path in FOLDER.glob("*/driver.py")}


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_is_whole(kind: str) -> None:
    manifest = manifest_of(kind)
    assert manifest.name
    assert manifest.summary.endswith(".")
    for parameter in manifest.parameters:
        assert parameter.summary.endswith("."), parameter.name
        read_values(manifest, {parameter.name: parameter.default})
    for endpoint in (*manifest.publishes, *manifest.subscribes):
        if "<" not in endpoint.type and "{" not in endpoint.type and "/msg/" in endpoint.type:
            message_class(endpoint.type)
    for endpoint in manifest.services:
        package, _, name = endpoint.type.split("/")
        assert hasattr(import_module(f"metaros.interfaces.{package}.srv"), name)


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_runs_with_what_ci_installs(kind: str) -> None:
    manifest = manifest_of(kind)
    if not manifest.runs_here:
        pytest.skip(f"it runs on {manifest.platforms}")
    assert manifest.missing() == ()
    assert callable(device_maker(kind))


@pytest.mark.parametrize("kind", KINDS)
def test_what_names_a_device_is_not_set_from_afar(kind: str) -> None:
    for parameter in manifest_of(kind).parameters:
        if parameter.name in ("port", "device", "source", "host", "address", "interface", "channel"):
            assert parameter.local, parameter.name


@pytest.mark.parametrize("kind", [kind for kind in KINDS if prober(kind)])
def test_what_a_probe_finds_can_be_run(kind: str) -> None:
    manifest = manifest_of(kind)
    ((_, found),) = probe([manifest])
    for device in found:
        assert device.kind == kind
        read_values(manifest, device.parameters)


def test_the_reference_is_as_the_manifests_say() -> None:
    subprocess.run([sys.executable, str(ROOT / "tools/gen_drivers.py"), "--check"], check=True, timeout=120)


def test_a_found_device_is_one_command_away() -> None:
    found = Found(kind="ld19", summary="x", parameters={"port": "/dev/my lidar", "bins": "100"})
    assert found.command == "metaros driver run ld19 --param 'port=/dev/my lidar' --param bins=100"


def test_a_kind_that_is_none_is_named() -> None:
    with pytest.raises(ConfigError, match="no driver 'toaster'; there are"):
        manifest_of("toaster")
    with pytest.raises(ConfigError, match="no driver"):
        manifest_of("../ld19")


def test_a_new_kind_passes_its_own_tests(tmp_path: Path) -> None:
    files = {path.name for path in scaffold("depth_probe", tmp_path)}
    assert files == {"__init__.py", "manifest.toml", "protocol.py", "driver.py", "test_depth_probe.py"}
    tests = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", tmp_path, tmp_path],
        cwd=tmp_path,
        env={**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert tests.returncode == 0, tests.stdout + tests.stderr
    assert "2 passed" in tests.stdout


@pytest.mark.parametrize("name", ["Depth", "1a", "a-b", "class", "json", "metaros", "../x", "test_x", "a"])
def test_a_name_that_cannot_be_a_package_of_ones_own(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigError, match=r"name"):
        scaffold(name, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_there_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "depth_probe").mkdir()
    with pytest.raises(ConfigError, match="is there already"):
        scaffold("depth_probe", tmp_path)


def test_a_folder_that_is_no_driver_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"manifest\.toml"):
        maker_in(tmp_path)
    scaffold("sonar_probe", tmp_path)
    (tmp_path / "sonar_probe" / "driver.py").write_text("")
    with pytest.raises(ConfigError, match=r"no make\(context\)"):
        maker_in(tmp_path / "sonar_probe")


def test_a_folder_never_takes_another_packages_name(tmp_path: Path) -> None:
    scaffold("other_probe", tmp_path)
    folder = tmp_path / "other_probe"
    renamed = folder.rename(tmp_path / "rich")
    text = (renamed / "manifest.toml").read_text().replace('kind = "other_probe"', 'kind = "rich"')
    (renamed / "manifest.toml").write_text(text)
    assert find_spec("rich") is not None
    import rich

    assert rich.__file__
    with pytest.raises(ConfigError, match="another package"):
        maker_in(renamed)
