"""A type checker accepts what users write with shipped interfaces and with message classes of their own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.examples.test_examples import ROOT

SHIPPED = """
from typing import assert_type
import numpy as np
import numpy.typing as npt
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.interfaces.geometry_msgs.msg import Quaternion
from metaros.interfaces.sensor_msgs.msg import BatteryState, Image, Imu
from metaros.interfaces.std_srvs.srv import Trigger

imu = Imu(orientation=Quaternion(w=0.5), orientation_covariance=[0.0] * 9)
assert_type(imu.orientation.w, float)
assert_type(imu.orientation_covariance, npt.NDArray[np.float64])
image = Image(data=b"abc", height=1)
status: int = BatteryState.POWER_SUPPLY_STATUS_FULL
response = Trigger.Response(success=True, message="done")
assert_type(response.success, bool)
goal = Fibonacci.Goal(order=3)
"""
SHIPPED_WRONG = "from metaros.interfaces.sensor_msgs.msg import Imu\nImu(orientatoin=None)\nImu(header=3)\n"
OWN = """
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
OWN_WRONG = """
import metaros

@metaros.message
class Cell:
    volts: metaros.float32 = 3.5

Cell(volts="much")
Cell(amperes=1.0)
Cell().volt
"""


@pytest.mark.integration
def test_a_type_checker_accepts_user_code(tmp_path: Path) -> None:
    wrong = {"shipped": (SHIPPED_WRONG, 2), "own": (OWN_WRONG, 3)}  # and how many complaints there are
    paths = []
    for name, code in (("shipped", SHIPPED), ("own", OWN), *((f"{name}_wrong", wrong[name][0]) for name in wrong)):
        paths.append(tmp_path / f"{name}.py")
        paths[-1].write_text(code)
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", *map(str, paths)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    complaints = [line.partition(":")[0] for line in done.stdout.splitlines() if ": error:" in line]
    found = {name: sum(f"{name}_wrong.py" in file for file in complaints) for name in wrong}
    assert found == {name: count for name, (_, count) in wrong.items()}, done.stdout + done.stderr
    assert len(complaints) == sum(found.values()), done.stdout
    exec(compile(SHIPPED, "shipped.py", "exec"), {"__name__": "shipped"})
