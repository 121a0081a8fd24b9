"""The raw peer's actions: five endpoints by hand, as a server and as a client."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from typing import Any, Protocol

import zenoh

from tests.ros2.participant import PATIENT, Fields, GoalRun, fibonacci
from tests.ros2.raw.cdr import decode, encode
from tests.ros2.raw.layouts import LAYOUTS
from tests.support.nodes.raw_peer import RawClient, RawPeer
from tests.support.waiting import wait_until

__all__ = ["RawActionServer", "run_goal"]

SEND, RESULT = "example_interfaces/action/Fibonacci_SendGoal", "example_interfaces/action/Fibonacci_GetResult"
CANCEL, STATUS = "action_msgs/srv/CancelGoal", "action_msgs/msg/GoalStatusArray"
FEEDBACK = "example_interfaces/action/Fibonacci_FeedbackMessage"
STATES = ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")
EXECUTING, SUCCEEDED, CANCELED = 2, 4, 5
NOW = {"sec": 1_700_000_000, "nanosec": 0}
ALL_TIMES = {"sec": 0, "nanosec": 0}
LATCHED, DEFAULT = ":1:,1:,:,:,,", "::,10:,:,:,,"
_ids = itertools.count(1)


class RawNodeLike(Protocol):
    """What is needed of the node."""

    peer: RawPeer

    def named(self, type_name: str) -> tuple[str, str]: ...

    def serve(self, name: str, type_name: str, answer: Callable[[Fields], Fields | None]) -> None: ...

    def publisher(self, topic: str, type_name: str, qos: str) -> Callable[[Fields], None]: ...

    def client(self, name: str, type_name: str) -> RawClient: ...

    def call(self, name: str, type_name: str, request: Fields) -> Fields: ...

    def listen(self, topic: str, type_name: str, *, latched: bool = False) -> Callable[[], list[Fields]]: ...

    @staticmethod
    def request(query: zenoh.Query, type_name: str) -> Fields: ...

    @staticmethod
    def reply(query: zenoh.Query, type_name: str, response: Fields) -> None: ...


class RawActionServer:
    """Fibonacci as every participant serves it. Zenoh's threads run it; `_lock` keeps what they share."""

    def __init__(self, node: RawNodeLike, name: str) -> None:
        self._node, prefix = node, f"{name}/_action"
        self._lock = threading.Lock()
        self._ends: dict[bytes, Fields] = {}  # results by the goal's id
        self._asked: dict[bytes, list[zenoh.Query]] = {}  # who waits for them
        self._feedback = node.publisher(f"{prefix}/feedback", FEEDBACK, DEFAULT)
        self._status = node.publisher(f"{prefix}/status", STATUS, LATCHED)
        node.serve(f"{prefix}/cancel_goal", CANCEL, self._cancel)
        node.peer.serve(f"{prefix}/get_result", *node.named(RESULT), self._result)
        node.peer.serve(f"{prefix}/send_goal", *node.named(SEND), self._send)

    def _send(self, query: zenoh.Query) -> None:
        request = self._node.request(query, SEND)
        order, goal = request["goal"]["order"], request["goal_id"]
        self._node.reply(query, SEND, {"accepted": order >= 0, "stamp": NOW})
        if order < 0:
            return
        self._tell(goal, EXECUTING)
        for sequence in fibonacci(min(order, 3) if order > PATIENT else order):
            self._feedback({"goal_id": goal, "feedback": {"sequence": sequence}})
        if order <= PATIENT:
            self._end(goal, SUCCEEDED, fibonacci(order)[-1])

    def _cancel(self, request: Fields) -> Fields:
        goal = request["goal_info"]["goal_id"]
        self._end(goal, CANCELED, [0, 1])
        return {"return_code": 0, "goals_canceling": [{"goal_id": goal, "stamp": NOW}]}

    def _result(self, query: zenoh.Query) -> None:
        key = bytes(self._node.request(query, RESULT)["goal_id"]["uuid"])
        with self._lock:
            end = self._ends.get(key)
            if end is None:
                self._asked.setdefault(key, []).append(query)
                return
        self._node.reply(query, RESULT, end)

    def _end(self, goal: Fields, status: int, sequence: list[int]) -> None:
        self._tell(goal, status)
        with self._lock:
            key = bytes(goal["uuid"])
            end = self._ends[key] = {"status": status, "result": {"sequence": sequence}}
            waiting = self._asked.pop(key, [])
        for query in waiting:
            self._node.reply(query, RESULT, end)

    def _tell(self, goal: Fields, status: int) -> None:
        self._status({"status_list": [{"goal_info": {"goal_id": goal, "stamp": NOW}, "status": status}]})


def run_goal(node: RawNodeLike, name: str, order: int, *, cancel: bool) -> GoalRun:
    """One goal, to its end."""
    prefix, goal = f"{name}/_action", {"uuid": list(next(_ids).to_bytes(16, "little"))}
    feedback = node.listen(f"{prefix}/feedback", FEEDBACK)
    status = node.listen(f"{prefix}/status", STATUS, latched=True)
    results = node.client(f"{prefix}/get_result", RESULT)
    if not node.call(f"{prefix}/send_goal", SEND, {"goal_id": goal, "goal": {"order": order}})["accepted"]:
        return GoalRun("REJECTED")
    seq, replies, _ = results.start(encode(LAYOUTS[RESULT][0], {"goal_id": goal}))  # held until it is done
    if cancel:
        info = {"goal_id": goal, "stamp": ALL_TIMES}
        wait_until(lambda: _told(status(), goal) == EXECUTING)
        answer = node.call(f"{prefix}/cancel_goal", CANCEL, {"goal_info": info})
        assert [one["goal_id"] for one in answer["goals_canceling"]] == [goal], answer
    end: Any = decode(LAYOUTS[RESULT][1], results.check(seq, replies.get(timeout=60)))
    wait_until(lambda: _told(status(), goal) == end["status"])
    told = [one["feedback"]["sequence"] for one in feedback() if one["goal_id"] == goal]
    return GoalRun(STATES[end["status"]], end["result"]["sequence"], told)


def _told(messages: list[Fields], goal: Fields) -> int:
    """Where the last status message that has the goal sees it; 0 where none does."""
    found = [
        one["status"] for message in messages for one in message["status_list"] if one["goal_info"]["goal_id"] == goal
    ]
    return found[-1] if found else 0
