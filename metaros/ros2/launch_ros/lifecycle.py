"""Lifecycle nodes of a launch: their transitions become events, and events their transitions."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any, Final

from metaros.errors import MetarosError
from metaros.node import Node
from metaros.ros2.launch.event_handlers import EventHandler, OnProcessStart
from metaros.ros2.launch_ros.events.lifecycle import ChangeState, StateTransition

__all__ = ["follow"]

CONFIGURE: Final = 1  # of lifecycle_msgs/msg/Transition
ACTIVATE: Final = 3
_WAIT_S: Final = 60.0
_LOOK_S: Final = 0.05


def follow(action: Any, context: Any, *, autostart: bool) -> None:
    """Tell the transitions of an action's node as events, and ask the node for those that events ask for."""
    from metaros.interfaces.lifecycle_msgs.msg import TransitionEvent
    from metaros.interfaces.lifecycle_msgs.srv import ChangeState as ChangeStateService

    name = action.full_name(context)
    node = _node_of(context)

    def tell(message: Any) -> None:
        context.emit_event_sync(StateTransition(action=action, msg=message))

    node.create_subscription(TransitionEvent, f"{name}/transition_event", tell, dedicated=True)
    client = node.create_client(ChangeStateService, f"{name}/change_state")

    async def ask(transition: int) -> bool:
        if not await _ready(client):
            context.runner.say("ERROR", name, f"no lifecycle node of that name within {_WAIT_S:g} s")
            return False
        request = ChangeStateService.Request()
        request.transition.id = transition
        try:
            done = bool((await client.call_async(request, _WAIT_S)).success)
        except MetarosError as error:
            context.runner.say("ERROR", name, f"transition {transition}: {error}")
            return False
        if not done:
            context.runner.say("ERROR", name, f"transition {transition} failed")
        return done

    async def start() -> None:
        if await ask(CONFIGURE):
            await ask(ACTIVATE)

    def on_change(event: Any, context: Any) -> list[Any]:
        context.runner.run_beside(action, ask(event.transition_id))
        return []

    context.register_event_handler(_OnChange(action, on_change))
    if autostart:

        def on_start(event: Any, context: Any) -> list[Any]:
            context.runner.run_beside(action, start())
            return []

        context.register_event_handler(OnProcessStart(target_action=action, on_start=on_start, handle_once=True))


async def _ready(client: Any) -> bool:
    """Whether the service is there in time. No thread waits, for which the launch would have to wait at its end."""
    for _ in range(round(_WAIT_S / _LOOK_S)):
        if client.service_is_ready():
            return True
        await asyncio.sleep(_LOOK_S)
    return bool(client.service_is_ready())


class _OnChange(EventHandler):
    def __init__(self, action: Any, then: Any) -> None:
        super().__init__(matcher=lambda event: isinstance(event, ChangeState) and event.lifecycle_node_matcher(action))
        self._then = then

    def handle(self, event: Any, context: Any) -> list[Any]:
        found: list[Any] = self._then(event, context)
        return found


def _node_of(context: Any) -> Node:
    """The launch's own node, made with the first lifecycle node, gone with the launch."""
    node: Node | None = context.runner.node
    if node is None:
        node = context.runner.node = Node("launch_ros", enable_rosout=False, enable_parameters=False)
        context.runner.at_end(partial(Node.close, node))
    return node
