"""The Python of two how-to pages, run as it stands there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.examples.test_examples import ROOT
from tests.support.processes import END_S, started


@pytest.mark.parametrize("page", ["custom_messages", "images_audio_points"])
def test_the_pages_python_runs(page: str, zenoh_router: str, tmp_path: Path) -> None:
    if page == "images_audio_points":
        pytest.importorskip("cv2")
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "howto" / f"{page}.md").read_text(), re.DOTALL)
    assert len(blocks) >= 4
    script = tmp_path / f"{page}.py"
    script.write_text("\n".join(blocks), encoding="utf-8")
    environment = {**os.environ, "METAROS_ZENOH_PORT": zenoh_router.rsplit(":", 1)[1]}
    with started([sys.executable, str(script)], stderr=subprocess.STDOUT, cwd=ROOT, env=environment) as process:
        out, _ = process.communicate(timeout=END_S)
    assert process.returncode == 0, out


USER_CODE = """
from typing import Annotated
import numpy as np
from numpy.typing import NDArray
import metaros

@metaros.message
class Cell:
    volts: metaros.float32 = 3.5

@metaros.message(name="my_robot/msg/Battery")
class Battery:
    cells: list[Cell]
    serial: Annotated[str, metaros.Bounded(5)] = ""
    grid: Annotated[NDArray[np.float32], metaros.Shape(2, 3)]

battery = Battery(cells=[Cell(volts=2.0)], grid=np.zeros((2, 3), np.float32))
total: float = sum(cell.volts for cell in battery.cells)
def hear(message: Battery) -> None:
    print(message.grid.shape, message.serial.upper())
def connect(node: metaros.Node) -> None:
    node.create_publisher(Battery, "battery").publish(battery)
    node.create_subscription(Battery, "battery", hear)
    node.create_publisher(str, "words").publish("hello")
    metaros.convert.image_to_numpy(metaros.convert.numpy_to_image(np.zeros((2, 3), np.uint8))).mean()
"""
WRONG = """
import metaros

@metaros.message
class Cell:
    volts: metaros.float32 = 3.5

Cell(volts="much")
Cell(amperes=1.0)
Cell().volt
"""


@pytest.mark.integration
def test_a_type_checker_understands_message_classes(tmp_path: Path) -> None:
    good, bad = tmp_path / "good.py", tmp_path / "bad.py"
    good.write_text(USER_CODE)
    bad.write_text(WRONG)
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", str(good), str(bad)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=100, check=False)
    complaints = [line for line in done.stdout.splitlines() if ": error:" in line]
    assert len(complaints) == 3, done.stdout + done.stderr
    assert all("bad.py" in line for line in complaints)
