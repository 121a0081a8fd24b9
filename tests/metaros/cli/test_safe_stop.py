"""The program of a safe stop: each part of it is done, whatever becomes of the others."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from metaros.cli import safe_stop
from metaros.cli.safe_stop import main
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.node import Context, Node, spin
from tests.support.waiting import wait_until


class Base:
    """The robot's base: who hears what moves it, and has a service that stops it."""

    def __init__(self, node: Node) -> None:
        self.heard: list[Twist] = []
        self.stops = 0
        node.create_subscription(Twist, "cmd_vel", self.heard.append)
        node.create_service(Trigger, "stop", self.on_stop)
        node.create_service(Trigger, "locked", self.on_locked)

    def on_stop(self, _request: Any, response: Any) -> Any:
        self.stops += 1
        response.success = True
        return response

    def on_locked(self, _request: Any, response: Any) -> Any:
        response.success, response.message = False, "no hands on it"
        return response


@pytest.fixture
def base(zenoh_router: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Base]:
    monkeypatch.setenv("METAROS_ZENOH_PORT", zenoh_router.rpartition(":")[2])
    monkeypatch.setattr(safe_stop, "EVERY_S", 0.01)
    with Context(connect=zenoh_router) as context:
        node = Node("base", namespace="/r1", context=context)
        found = Base(node)
        thread = threading.Thread(target=spin, args=(node,), daemon=True)
        thread.start()
        yield found
        node.close()
        thread.join(60)


def command(path: Path, *, code: int = 0) -> list[str]:
    return [sys.executable, "-S", "-c", f"open({str(path)!r}, 'w').close(); raise SystemExit({code})"]


def test_all_that_was_asked_for_is_done(base: Base, tmp_path: Path) -> None:
    twist = "cmd_vel=geometry_msgs/msg/Twist"
    words = ["--namespace", "/r1", "--publish", twist, "--call", "stop", "--", *command(tmp_path / "ran")]

    assert main(words) == 0

    wait_until(lambda: Twist() in base.heard)
    assert base.stops == 1
    assert (tmp_path / "ran").exists()


def test_no_part_keeps_the_others_from_their_turn(
    base: Base, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--namespace", "/r1", "--publish", "cmd_vel=no_such/msg/Type", "--publish"]
    words += ["cmd_vel=geometry_msgs/msg/Twist", "--call", "locked", "--call", "stop"]

    assert main([*words, "--", *command(tmp_path / "ran", code=3)]) == 1

    wait_until(lambda: Twist() in base.heard)
    assert base.stops == 1
    said = capsys.readouterr().err
    assert "exit code 3" in said
    assert "refused: no hands on it" in said
    assert "no_such" in said
