"""PyPI roslibpy, unmodified, against the gateway's rosbridge: a line of JSON a step, for test_rosbridge_clients.py."""

from __future__ import annotations

import json
import sys
import threading
from typing import Any

import roslibpy  # type: ignore[import-untyped]

__all__: list[str] = []

WAIT_S = 60


def say(step: str, value: Any = None) -> None:
    """One step is done."""
    print(json.dumps({step: value}), flush=True)


def first(ros: Any, name: str, kind: str) -> Any:
    """The first message of a topic."""
    received: list[Any] = []
    there = threading.Event()
    topic = roslibpy.Topic(ros, name, kind, throttle_rate=20, queue_length=1)

    def hear(message: Any) -> None:
        received.append(dict(message))
        there.set()

    topic.subscribe(hear)
    assert there.wait(WAIT_S), name
    topic.unsubscribe()
    return received[0]


def goal(ros: Any, order: int, *, cancel: bool = False) -> dict[str, Any]:
    """Send a goal to count; what came of it."""
    found: dict[str, Any] = {"feedback": 0}
    client = roslibpy.ActionClient(ros, "/sim_1/count", "example_interfaces/action/Fibonacci")
    begun, over = threading.Event(), threading.Event()

    def feedback(_values: Any) -> None:
        found["feedback"] += 1
        begun.set()

    def result(said: Any) -> None:
        found.update(status=said["status"].name, values=said["values"])
        over.set()

    number = client.send_goal(roslibpy.Goal({"order": order}), result, feedback, result)
    if cancel:
        assert begun.wait(WAIT_S)
        client.cancel_goal(number)
    assert over.wait(WAIT_S)
    return found


def main(url: str) -> None:
    """The whole scenario."""
    ros = roslibpy.Ros(url)
    ros.run(timeout=WAIT_S)
    say("topics", ros.get_topics())
    say("topic_type", ros.get_topic_type("/sim_1/chatter"))
    say("services", ros.get_services())
    say("service_type", ros.get_service_type("/sim_1/add"))
    say("nodes", ros.get_nodes())
    say("time", dict(ros.get_time()))
    say("details", dict(ros.get_message_details("std_msgs/msg/String")))
    say("chatter", first(ros, "/sim_1/chatter", "std_msgs/String"))
    scan = first(ros, "/sim_1/scan", "sensor_msgs/msg/LaserScan")
    say("scan", scan["ranges"][:4])
    echo = roslibpy.Topic(ros, "/sim_1/echo", "std_msgs/String")
    for number in range(20):
        echo.publish(roslibpy.Message({"data": f"py {number}"}))
    say("published")
    sys.stdin.readline()
    echo.unadvertise()
    add = roslibpy.Service(ros, "/sim_1/add", "example_interfaces/AddTwoInts")
    say("sum", dict(add.call(roslibpy.ServiceRequest({"a": 3, "b": 4}), timeout=WAIT_S)))
    mine = roslibpy.Service(ros, "/sim_1/py_add", "example_interfaces/AddTwoInts")

    def answer(request: Any, response: Any) -> bool:
        response["sum"] = request["a"] + request["b"] + 2000
        return True

    mine.advertise(answer)
    say("serving")
    sys.stdin.readline()
    mine.unadvertise()
    say("goal", goal(ros, 6))
    say("cancelled", goal(ros, 1000, cancel=True))
    speed = roslibpy.Param(ros, "/sim_1/base:speed")
    say("speed", speed.get())
    speed.set(3.25)
    say("faster", speed.get())
    say("params", [name for name in ros.get_params() if name.endswith(":speed")])
    ros.close()
    say("done")
    ros.terminate()


if __name__ == "__main__":
    main(sys.argv[1])
