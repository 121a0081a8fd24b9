"""A program with its own types, which the testing process must not import: run it with `custom_types_robot()`."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from tests.support.processes.processes import started
from tests.support.waiting import wait_until


@contextmanager
def custom_types_robot(router: str, log: Path, *, namespace: str = "/") -> Iterator[None]:
    """The program in a process, from when it publishes until the end of the block."""
    environment = {**os.environ, "METAROS_ZENOH_PORT": router.rsplit(":", 1)[1]}
    command = [sys.executable, "-m", "tests.support.robots.custom_types_robot", namespace]
    root = Path(__file__).parents[3]
    with (
        log.open("wb") as out,
        started(command, stdout=out, stderr=subprocess.STDOUT, env=environment, cwd=root) as process,
    ):
        wait_until(lambda: b"ready" in log.read_bytes() or process.poll() is not None, timeout_s=60)
        assert process.poll() is None, log.read_text()
        yield


def main() -> None:
    """A node with types of its own.

    It publishes `hand`, of a new type, and `other`, of a shipped name with other fields; hears `squeeze` and says what
    it heard in `squeezed`; serves the service `wave` and the action `reach`, of new types.
    """
    import metaros
    from metaros.idl import Catalogue, default_catalogue, message_class, parse_definition
    from metaros.interfaces.std_msgs.msg import Header

    @metaros.message(name="far_robot/msg/Finger")
    class Finger:
        angle: metaros.float32 = 0.25

    @metaros.message(name="far_robot/msg/Hand")
    class Hand:
        header: Header
        fingers: list[Finger]
        grip: Annotated[str, metaros.Bounded(8)] = "soft"

    @metaros.message(name="std_msgs/msg/Int8")
    class OtherInt8:
        data: metaros.int16 = 77

    def wave(request: Any, response: Any) -> None:
        response.done, response.angle = True, request.times * 0.5

    def reach(goal: Any) -> Any:
        for joint in goal.request.path:
            goal.publish_feedback(reaching.Feedback(now=joint))
        goal.succeed()
        return reaching.Result(error=len(goal.request.path) * 0.5)

    text = "string<=8 how\nint16 times\nstd_msgs/Header header\n---\nbool done\nfloat64 angle\n"
    own = Catalogue(base=default_catalogue())
    own.add(parse_definition(text, "far_robot/srv/Wave"))
    own.add(parse_definition("float32 angle\nstring name\n", "far_robot/msg/Joint"))
    text = "uint8 FAST=2\nJoint[] path\nuint8 speed 1\n---\nfloat64 error\n---\nJoint now\n"
    own.add(parse_definition(text, "far_robot/action/Reach"))
    own.add(parse_definition("uint16 force 5\nJoint joint\n", "far_robot/msg/Squeeze"))
    reaching = message_class("far_robot/action/Reach", own)
    with metaros.Node("hand", namespace=sys.argv[1]) as node:
        hands, others = node.create_publisher(Hand, "hand"), node.create_publisher(OtherInt8, "other")
        node.create_timer(0.05, lambda: hands.publish(Hand(fingers=[Finger(), Finger(angle=1.5)])))
        node.create_timer(0.05, lambda: others.publish(OtherInt8()))
        squeezed = node.create_publisher(str, "squeezed", metaros.qos_transient_local)
        node.create_subscription(
            message_class("far_robot/msg/Squeeze", own),
            "squeeze",
            lambda message: squeezed.publish(f"{message.joint.name} {message.force}"),
        )
        node.create_service(message_class("far_robot/srv/Wave", own), "wave", wave)
        node.create_action_server(reaching, "reach", reach)
        print("ready", flush=True)
        metaros.spin(node)


if __name__ == "__main__":
    main()
