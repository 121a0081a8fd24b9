"""`rclpy.lifecycle.node`: the managed node of ROS 2 in rclpy's shape, on this library's lifecycle."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any, cast

from metaros.errors import UsageError
from metaros.node.lifecycle.hooks import run_plain
from metaros.node.lifecycle.interface import Lifecycle
from metaros.node.lifecycle.state_machine import Result, State
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.core.rcl_errors import RCLError
from metaros.ros2.rclpy.lifecycle.managed_entity import ManagedEntity
from metaros.ros2.rclpy.lifecycle.publisher import LifecyclePublisher
from metaros.ros2.rclpy.lifecycle.state_machine import LifecycleStateMachine
from metaros.ros2.rclpy.lifecycle.transitions import RESULTS, RETURNS, LifecycleState, TransitionCallbackReturn

__all__ = ["LifecycleNode", "LifecycleNodeMixin", "LifecycleState", "TransitionCallbackReturn"]

Answer = TransitionCallbackReturn
_SUCCESS = TransitionCallbackReturn.SUCCESS


class _Hooks:
    """The node's callbacks as the library's lifecycle asks for them: by name, states and results in its own terms.

    It refers to the node weakly: who serves its states does not keep it.
    """

    def __init__(self, node: Any) -> None:
        self.full_name = node.handle.full_name
        self._node = weakref.ref(node)

    def __getattr__(self, name: str) -> Callable[[State], Result]:
        node = self._node()
        callback = None if node is None else node._callbacks.get(name)
        if callback is None:
            raise AttributeError(f"no callback {name!r}")

        def ask(before: State) -> Result:
            answer = callback(LifecycleState(before.label, before.id))
            if answer not in RESULTS:
                raise UsageError(f"{name} must return a TransitionCallbackReturn, not {answer!r}")
            return RESULTS[answer]

        return ask


class LifecycleNodeMixin(ManagedEntity):
    """What a lifecycle adds to a node, whose constructor runs before this one's.

    Override `on_configure` … and return a `TransitionCallbackReturn`; an exception is logged and counts as an error.
    As they are, they ask the managed entities in turn, up to the first that does not succeed: call `super()` for that.
    Without `enable_communication_interface` nobody else sees or changes the state.
    """

    def __init__(self, *, enable_communication_interface: bool = True, callback_group: Any = None) -> None:
        if not isinstance(enable_communication_interface, bool):
            raise TypeError(
                f"enable_communication_interface must be True or False, not {enable_communication_interface!r}"
            )
        this: Any = self  # a node, too
        self._managed_entities: dict[ManagedEntity, None] = {}  # in the order in which they were added
        names = ("configure", "cleanup", "shutdown", "activate", "deactivate", "error")
        self._callbacks = {f"on_{name}": getattr(self, f"on_{name}") for name in names}
        self._lifecycle = Lifecycle(
            this.handle,
            hooks=_Hooks(self),
            offered=enable_communication_interface,
            group=this.default_callback_group if callback_group is None else callback_group,
        )
        self._state_machine = LifecycleStateMachine(self._lifecycle)
        for name, service in self._lifecycle.services.items():
            setattr(self, f"_service_{name}", service)

    # -- transitions -----------------------------------------------------------------------------------------------

    def trigger_configure(self) -> TransitionCallbackReturn:
        """From unconfigured to inactive, now; what `on_configure` returned. RCLError where it is not possible."""
        return self.__change("configure")

    def trigger_cleanup(self) -> TransitionCallbackReturn:
        """From inactive to unconfigured, as `trigger_configure`."""
        return self.__change("cleanup")

    def trigger_shutdown(self) -> TransitionCallbackReturn | None:
        """To finalized; what `on_shutdown` returned, None where the node is finalized already."""
        return self.__change("shutdown") if self._lifecycle.can("shutdown") else None

    def trigger_activate(self) -> TransitionCallbackReturn:
        """From inactive to active, as `trigger_configure`."""
        return self.__change("activate")

    def trigger_deactivate(self) -> TransitionCallbackReturn:
        """From active to inactive, as `trigger_configure`."""
        return self.__change("deactivate")

    def __change(self, transition: str) -> TransitionCallbackReturn:
        try:
            return RETURNS[run_plain(self._lifecycle.change(transition))]
        except UsageError as error:
            raise RCLError(str(error)) from None

    # -- callbacks -------------------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Get ready."""
        return self.__ask("on_configure", state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Undo what configuring did."""
        return self.__ask("on_cleanup", state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The end."""
        return self.__ask("on_shutdown", state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start to work."""
        return self.__ask("on_activate", state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Rest."""
        return self.__ask("on_deactivate", state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Clean up after a callback that went wrong: success leads to unconfigured, all else to finalized."""
        return self.__ask("on_error", state)

    def __ask(self, name: str, state: LifecycleState) -> TransitionCallbackReturn:
        for entity in list(self._managed_entities):
            answer: TransitionCallbackReturn = getattr(entity, name)(state)
            if answer is not _SUCCESS:
                return answer
        return _SUCCESS

    # -- entities --------------------------------------------------------------------------------------------------

    def add_managed_entity(self, entity: ManagedEntity) -> None:
        """Have it follow the node's transitions."""
        self._managed_entities[entity] = None

    def create_lifecycle_publisher(self, *args: Any, **kwargs: Any) -> LifecyclePublisher:
        """As `create_publisher`: one that is silent unless the node is active."""
        if "publisher_class" in kwargs:
            raise TypeError("create_lifecycle_publisher takes no publisher_class: it makes a LifecyclePublisher")
        this: Any = self
        publisher: Any = Node.create_publisher(this, *args, **kwargs, publisher_class=LifecyclePublisher)
        self.add_managed_entity(publisher)
        return cast("LifecyclePublisher", publisher)

    def destroy_lifecycle_publisher(self, publisher: LifecyclePublisher) -> bool:
        """Destroy it; whether it was the node's."""
        self._managed_entities.pop(publisher, None)
        this: Any = self
        return Node.destroy_publisher(this, publisher)


class LifecycleNode(LifecycleNodeMixin, Node):
    """A node with a lifecycle; the options are those of `Node`."""

    def __init__(self, node_name: str, *, enable_communication_interface: bool = True, **kwargs: Any) -> None:
        Node.__init__(self, node_name, **kwargs)
        LifecycleNodeMixin.__init__(self, enable_communication_interface=enable_communication_interface)
        self.handle.made()
