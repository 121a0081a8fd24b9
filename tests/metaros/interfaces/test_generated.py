"""The generated modules and stubs: no drift, and they import."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from metaros.idl import message_class
from metaros.idl.catalogue import shipped_names

ROOT = Path(__file__).resolve().parents[3]


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
