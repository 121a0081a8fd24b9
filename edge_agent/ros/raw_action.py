"""An action's client in CDR bytes: goals of types that this agent need not know. Pure functions, and the endpoints.

Every part of an action begins with the goal's 16 bytes, and 16 is a multiple of every alignment: so a goal's own CDR
can be put behind them, and the id be read off feedback, without the type.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Final

import zenoh

from metaros.cdr import codec
from metaros.errors import PeerError, UnavailableError, UsageError
from metaros.limits import LIMITS
from metaros.node import Node
from metaros.node.action.types import ENDPOINTS, id_of
from metaros.node.client import RawClient
from metaros.node.pending_call import Reply
from metaros.node.subscription import RawSubscription, Subscription
from metaros.wire import EndpointInfo, qos_default, qos_transient_local
from metaros.wire.shm import intact

__all__ = ["RawAction", "cancel_request", "find_endpoints", "goal_id_of", "goal_request", "result_request", "statuses"]

HEADER_BYTES: Final = 4
ID_BYTES: Final = 16
SERVICES: Final = ("send_goal", "cancel_goal", "get_result")
LITTLE: Final = b"\x00\x01\x00\x00"
LOOK_S: Final = 0.05


def goal_request(goal_id: bytes, goal: bytes) -> bytes:
    """CDR of X_SendGoal_Request, from that of X_Goal."""
    if len(goal) < HEADER_BYTES or len(goal_id) != ID_BYTES:
        raise UsageError("a goal has an id of 16 bytes and at least a CDR header")
    return goal[:HEADER_BYTES] + goal_id + goal[HEADER_BYTES:]


def result_request(goal_id: bytes) -> bytes:
    """CDR of X_GetResult_Request."""
    return LITTLE + goal_id


def cancel_request(goal_id: bytes) -> bytes:
    """CDR of action_msgs/srv/CancelGoal_Request for one goal, whenever it was accepted."""
    return LITTLE + goal_id + bytes(8)


def goal_id_of(feedback: bytes) -> bytes:
    """Whose feedback it is."""
    return feedback[HEADER_BYTES : HEADER_BYTES + ID_BYTES]


def statuses(array: bytes) -> dict[bytes, int]:
    """Goals and their numbers, of an action_msgs/msg/GoalStatusArray. DecodeError where it is none."""
    entries = codec("action_msgs/msg/GoalStatusArray").decode(array).status_list
    return {id_of(entry.goal_info.goal_id): int(entry.status) for entry in entries}


class RawAction:
    """The five endpoints of one action's client.

    `on_feedback` runs on Zenoh's thread, on which results come, too: it has received what was published before a result
    by the time that is here. It must not block. `on_status` runs on a thread of its own.
    """

    def __init__(
        self,
        node: Node,
        name: str,
        endpoints: Mapping[str, EndpointInfo],
        on_feedback: Callable[[bytes], None],
        on_status: Callable[[bytes], None],
    ) -> None:
        self.name = name
        self.type_name = endpoints["send_goal"].type_name.removesuffix("_SendGoal")
        self.type_hash = endpoints["send_goal"].type_hash
        self.users = 0
        named = {part: (end.topic, end.type_name, end.type_hash) for part, end in endpoints.items()}
        clients = [node.create_raw_client(*named[part]) for part in SERVICES]
        self._send, self._cancel, self._result = clients
        self._closing: list[RawClient | RawSubscription | Subscription] = [
            *clients,
            node.create_raw_subscription(*named["feedback"], qos_default, partial(_hear, on_feedback)),
            Subscription(node, *named["status"], qos_transient_local, on_status, decode=bytes, dedicated=True),
        ]

    async def send(self, goal_id: bytes, goal: bytes, timeout_s: float) -> bytes:
        """Send a goal; CDR of X_SendGoal_Response."""
        answer: bytes = await self._send.call_async(goal_request(goal_id, goal), timeout_s)
        return answer

    async def cancel(self, goal_id: bytes, timeout_s: float) -> bytes:
        """CDR of CancelGoal_Response."""
        answer: bytes = await self._cancel.call_async(cancel_request(goal_id), timeout_s)
        return answer

    def result(self, goal_id: bytes) -> Reply[bytes]:
        """CDR of X_GetResult_Response, to await for as long as the server lives."""
        return self._result.begin(result_request(goal_id), bytes, None)

    def close(self) -> None:
        """Leave the graph."""
        for endpoint in reversed(self._closing):
            with suppress(PeerError, UsageError):
                endpoint.close()


def _hear(on_feedback: Callable[[bytes], None], sample: zenoh.Sample) -> None:
    """Feedback as it came, unless it is too large for any message or was taken back before it was copied."""
    if len(sample.payload) <= LIMITS.sample_bytes:
        feedback = sample.payload.to_bytes()
        if len(feedback) < LIMITS.shared_memory_threshold_bytes or intact(sample.payload):
            on_feedback(feedback)


async def find_endpoints(
    node: Node, action: str, type_name: str, type_hash: str, timeout_s: float
) -> dict[str, EndpointInfo]:
    """The endpoints of an action's server, as soon as all are in the graph; UnavailableError."""
    for _ in range(max(1, round(min(timeout_s, 2.0) / LOOK_S))):
        endpoints = {
            part: end
            for part, suffix in ENDPOINTS.items()
            for end in node.graph.endpoints(action + suffix, "MP" if part in ("feedback", "status") else "SS")
        }
        first = endpoints.get("send_goal")
        if first is not None and first.type_name != f"{type_name}_SendGoal":
            raise UnavailableError(f"{action} is of type {first.type_name.removesuffix('_SendGoal')}, not {type_name}")
        if first is not None and type_hash not in ("", first.type_hash):
            raise UnavailableError(f"{action} is of another version of {type_name}")
        if len(endpoints) == len(ENDPOINTS):
            return endpoints
        await asyncio.sleep(LOOK_S)
    raise UnavailableError(f"nobody serves the action {action}")
