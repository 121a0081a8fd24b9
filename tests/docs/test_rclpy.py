"""What programs for ROS 2 can import and set is all on its page; the snippet of the other page runs."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from metaros.idl.catalogue import shipped_names
from metaros.ros2.finder import PACKAGES
from metaros.ros2.programs import environment
from metaros.ros2.rclpy.module_names import HOMES

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "docs" / "reference" / "rclpy.md"
HOWTO = ROOT / "docs" / "howto" / "coming_from_rclpy.md"
VARIABLE = re.compile(r'"((?:RCUTILS|ROS|METAROS|ZENOH)_[A-Z_]+|AMENT_PREFIX_PATH|RMW_IMPLEMENTATION)"')
ELSEWHERE = {"METAROS_ALLOCATOR", "ZENOH_ROUTER_CONFIG_URI", "ZENOH_RUNTIME"}  # of every program of ours, or of routers


def unnamed(names: set[str], text: str) -> list[str]:
    """Those that do not stand in backquotes in the text."""
    return sorted(name for name in names if f"`{name}`" not in text)


def test_every_module_and_package_is_on_the_page() -> None:
    text = REFERENCE.read_text()
    holders = {name.rpartition(".")[0] for name in HOMES}  # `rclpy.impl` is none itself
    assert unnamed({f"rclpy.{name}" for name in HOMES}, text) == []
    assert unnamed(set(PACKAGES), text) == []
    named = set(re.findall(r"`rclpy\.([a-z_0-9.]+)`", text.partition("## Modules of rclpy")[2]))
    assert named - set(HOMES) - holders == set()
    catalogue = (ROOT / "docs" / "reference" / "interfaces.md").read_text()
    assert unnamed({name.partition("/")[0] for name in shipped_names()}, catalogue) == []


def test_every_variable_that_is_read_is_on_the_page() -> None:
    read = {
        name
        for folder in ("ros2", "wire", "idl")
        for path in (ROOT / "metaros" / folder).rglob("*.py")
        for name in VARIABLE.findall(path.read_text())
    }
    assert {"ROS_DOMAIN_ID", "RCUTILS_COLORIZED_OUTPUT", *environment.DEFAULTS} <= read
    assert unnamed(read - ELSEWHERE, REFERENCE.read_text()) == []


@pytest.mark.integration
def test_the_snippet_runs(zenoh_router: str) -> None:
    (snippet,) = re.findall(r"```python\n(.*?)```", HOWTO.read_text(), re.DOTALL)
    environ = {**os.environ, "METAROS_ZENOH_PORT": zenoh_router.rpartition(":")[2]}
    subprocess.run([sys.executable, "-W", "error", "-c", snippet], env=environ, check=True)
