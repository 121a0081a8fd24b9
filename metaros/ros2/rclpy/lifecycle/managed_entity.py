"""`rclpy.lifecycle.managed_entity`: what follows its node's transitions."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, overload

from metaros.ros2.rclpy.lifecycle.transitions import LifecycleState, TransitionCallbackReturn

__all__ = ["ManagedEntity", "SimpleManagedEntity"]

P = ParamSpec("P")
T = TypeVar("T")
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
_SUCCESS = TransitionCallbackReturn.SUCCESS


class ManagedEntity:
    """One method a transition, given the state before it; each succeeds unless a subclass says otherwise."""

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Get ready."""
        return _SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Undo what configuring did."""
        return _SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The end."""
        return _SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start to work."""
        return _SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Rest."""
        return _SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Clean up after a callback that went wrong: success leads to unconfigured, all else to finalized."""
        return _SUCCESS


class SimpleManagedEntity(ManagedEntity):
    """Knows whether it is activated."""

    def __init__(self) -> None:
        self._enabled = False

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """It is activated from now on."""
        self._enabled = True
        return _SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """It is not any more."""
        self._enabled = False
        return _SUCCESS

    @property
    def is_activated(self) -> bool:
        """Whether it is."""
        return self._enabled

    @overload
    @staticmethod
    def when_enabled(wrapped: None = None, *, when_not_enabled: Callable[..., Any] | None = None) -> Decorator: ...

    @overload
    @staticmethod
    def when_enabled(
        wrapped: Callable[P, T], *, when_not_enabled: Callable[..., Any] | None = None
    ) -> Callable[P, T | None]: ...

    @staticmethod
    def when_enabled(
        wrapped: Callable[..., Any] | None = None, *, when_not_enabled: Callable[..., Any] | None = None
    ) -> Any:
        """Decorate a method that runs only while its entity is activated; else `when_not_enabled()` does, if given."""

        def decorate(method: Callable[..., Any]) -> Callable[..., Any]:
            @functools.wraps(method)
            def run(self: SimpleManagedEntity, *args: Any, **kwargs: Any) -> Any:
                if self._enabled:
                    return method(self, *args, **kwargs)
                return None if when_not_enabled is None else when_not_enabled()

            return run

        return decorate if wrapped is None else decorate(wrapped)
