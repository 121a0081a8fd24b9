"""The generated modules and stubs: no drift, they import, and a type checker accepts what users write."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from metaros.idl import message_class
from metaros.idl.catalogue import shipped_names

ROOT = Path(__file__).resolve().parents[3]

USER_CODE = """
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
WRONG = "from metaros.interfaces.sensor_msgs.msg import Imu\nImu(orientatoin=None)\nImu(header=3)\n"


def test_no_drift() -> None:
    command = [sys.executable, "tools/gen_interfaces.py", "--check"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr


def test_every_class_can_be_imported() -> None:
    for name in shipped_names():
        package, kind, short = name.split("/")
        module = importlib.import_module(f"metaros.interfaces.{package}.{kind}")
        assert getattr(module, short) is message_class(name)
        assert short in module.__all__
        assert short in dir(module)


def test_derived_classes_and_unknown_names() -> None:
    module = importlib.import_module("metaros.interfaces.std_srvs.srv")
    assert module.Trigger_Request is module.Trigger.Request
    with pytest.raises(AttributeError, match="std_srvs has no srv 'Nope'"):
        _ = module.Nope
    with pytest.raises(ImportError):
        exec("from metaros.interfaces.std_msgs.msg import Nope")


@pytest.mark.integration
def test_a_type_checker_accepts_user_code(tmp_path: Path) -> None:
    good, bad = tmp_path / "good.py", tmp_path / "bad.py"
    good.write_text(USER_CODE)
    bad.write_text(WRONG)
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", str(good), str(bad)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    complaints = [line for line in done.stdout.splitlines() if ": error:" in line]
    assert len(complaints) == 2, done.stdout + done.stderr
    assert all("bad.py" in line for line in complaints)
    exec(compile(USER_CODE, "good.py", "exec"), {"__name__": "good"})
