"""The talkers and the listeners, of ROS and of ZeroMQ, which meet at `metaros broker`; as a user would run them."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from tests.examples.test_examples import running
from tests.support.ports import free_port
from tests.support.waiting import wait_until

ROS_EARS = ("listener.py", "async_listener.py")


def test_everybody_hears_either_talker(zenoh_router: str, tmp_path: Path) -> None:
    xsub, xpub, zenoh = str(free_port()), str(free_port()), zenoh_router.rsplit(":", 1)[1]

    def log(name: str) -> Path:
        return tmp_path / f"{name}.log"

    def received(name: str) -> int:
        return log(name).read_text().count("Hello World")

    def example(name: str, *options: str) -> None:
        stack.enter_context(running([f"examples/{name}", *options], zenoh, log(name)))

    with ExitStack() as stack:  # the last one to start is the first to end
        broker = ["-m", "metaros", "broker", "--xsub", xsub, "--xpub", xpub, "--zenoh-port", zenoh]
        stack.enter_context(running(broker, zenoh, log("broker")))
        for name in ROS_EARS:
            example(name)
        example("zeromq_subscriber.py", "--port", xpub)
        with running(["examples/talker.py"], zenoh, log("talker.py")):
            wait_until(lambda: all(received(name) for name in (*ROS_EARS, "zeromq_subscriber.py")))
        before = {
            name: received(name) for name in ROS_EARS
        }  # all that the talker has said has come by now, or will not
        example("zeromq_publisher.py", "--port", xsub)
        wait_until(lambda: all(received(name) > before[name] + 1 for name in ROS_EARS))
