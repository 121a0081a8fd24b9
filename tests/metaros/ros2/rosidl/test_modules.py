"""Modules of message packages, and programs' imports that lead to them."""

from __future__ import annotations

import importlib
import pickle
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from metaros.idl.catalogue import default_catalogue, shipped_names
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.rosidl.modules import package_module


def test_every_shipped_package_is_there() -> None:
    wrong = []
    for name in shipped_names():
        package, kind, short = name.split("/")
        cls = interface(name)
        module: Any = package_module(f"{package}.{kind}")
        file: Any = package_module(cls.__module__)
        places = (getattr(module, short), getattr(file, short), getattr(package_module(package), kind))
        if places != (cls, cls, module) or short not in module.__all__ or short not in dir(module):
            wrong.append(name)
        if getattr(file, f"Metaclass_{short}") is not type(cls) or hasattr(module, "Nothing"):
            wrong.append(name)
    assert not wrong


def test_what_there_is_not() -> None:
    names = ["nothing", "nothing.msg", "std_msgs.srv", "std_msgs.msg._nothing", "std_msgs.msg.String", "std_msgs.text"]
    assert {name: package_module(name) for name in names} == dict.fromkeys(names)
    with pytest.raises(AttributeError, match=r"'std_msgs.msg' has no attribute 'Strng'"):
        _ = package_module("std_msgs.msg").Strng  # type: ignore[union-attr]
    assert dir(package_module("std_srvs"))[-1] == "srv"


def test_parts_of_services_and_actions() -> None:
    srv: Any = package_module("std_srvs.srv")
    assert srv.Trigger_Request is srv.Trigger.Request
    assert {"Trigger", "Trigger_Request", "Trigger_Response", "Trigger_Event"} <= set(srv.__all__)
    file: Any = package_module("example_interfaces.action._fibonacci")
    assert (
        file.Fibonacci_SendGoal_Request is interface("example_interfaces/action/Fibonacci").Impl.SendGoalService.Request
    )
    assert "Fibonacci_GetResult_Event" in dir(file)
    assert not hasattr(file, "__path__")


@pytest.mark.usefixtures("ros2_names")
def test_imports_of_programs() -> None:
    scope: dict[str, Any] = {}
    exec(
        "import std_msgs.msg\nfrom std_srvs.srv import Trigger, SetBool_Request\nfrom geometry_msgs import msg\n"
        "from sensor_msgs.msg import *\nfrom std_msgs.msg._string import String, Metaclass_String",
        scope,
    )
    assert scope["std_msgs"].msg.String is scope["String"] is interface("std_msgs/msg/String")
    assert (scope["msg"].Twist().linear.x, scope["Image"]().height) == (0.0, 0)
    assert scope["Trigger"].Request is interface("std_srvs/srv/Trigger").Request
    assert pickle.loads(pickle.dumps(scope["String"])) is scope["String"]
    assert sys.modules["std_msgs.msg"] is importlib.import_module("std_msgs.msg") is package_module("std_msgs.msg")
    with pytest.raises(ImportError, match="Strng"):
        exec("from std_msgs.msg import Strng")
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("std_msgs.srv")


def test_a_bad_file_is_named_where_it_is_imported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "bad_file_msgs" / "msg" / "Bad.msg"
    file.parent.mkdir(parents=True)
    file.write_text("what is this")
    monkeypatch.setenv("METAROS_INTERFACE_PATH", str(tmp_path))
    module: Any = package_module("bad_file_msgs.msg")
    with pytest.raises(ImportError, match=r"Bad\.msg: bad_file_msgs/msg/Bad, line 1"):
        _ = module.Bad
    assert not hasattr(module, "Other")
    assert "bad_file_msgs/msg/Bad" not in default_catalogue().names()  # nobody is told to try it


def test_a_name_that_no_package_has_is_answered_while_the_catalogue_is_at_work() -> None:
    """Whoever makes a class may import numpy, and whoever imports numpy may ask for names that nobody has."""
    catalogue = default_catalogue()
    answers: list[Any] = []
    asking = threading.Thread(target=lambda: answers.append(package_module("nobody_has_this")))
    with catalogue._lock:
        asking.start()
        asking.join(60)
    assert answers == [None]
    assert package_module("std_msgs") is not None
