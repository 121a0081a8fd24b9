"""What a launch knows while it runs: its configurations, environment, namespaces, and who listens to its events."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

from metaros.ros2.launch.substitution import Substitution

__all__ = ["LaunchContext"]


class LaunchContext:
    """Configurations are texts by name, and belong to the group in which they were set."""

    def __init__(self, *, argv: Sequence[str] | None = None, noninteractive: bool = False) -> None:
        self.argv = list(argv or ())
        self.noninteractive = noninteractive
        self.launch_configurations: dict[str, str] = {}
        self.locals = SimpleNamespace()
        self.is_shutdown = False
        self.asyncio_loop: asyncio.AbstractEventLoop | None = None
        self.runner: Any = None  # of the service that runs this launch
        self._scopes: list[tuple[dict[str, str], dict[str, str] | None, dict[str, Any]]] = []
        self._handlers: list[Any] = []

    @property
    def environment(self) -> MutableMapping[str, str]:
        """That of this process: what is started inherits it."""
        return os.environ

    def perform_substitution(self, substitution: Substitution) -> str:
        """Its text."""
        return substitution.perform(self)

    # -- scopes ----------------------------------------------------------------------------------------------------

    def push(self, *, forwarding: bool = True, keep: Mapping[str, str] | None = None) -> None:
        """Begin a group. Without `forwarding` it knows the configurations `keep` alone, and its environment ends
        with it."""
        environment = None if forwarding and keep is None else dict(os.environ)
        self._scopes.append((dict(self.launch_configurations), environment, dict(vars(self.locals))))
        if not forwarding:
            self.launch_configurations.clear()
        self.launch_configurations.update(keep or {})

    def pop(self) -> None:
        """End it: what was set inside is forgotten."""
        configurations, environment, local = self._scopes.pop()
        self.launch_configurations.clear()
        self.launch_configurations.update(configurations)
        if environment is not None:
            os.environ.clear()
            os.environ.update(environment)
        self.locals.__dict__.clear()
        self.locals.__dict__.update(local)

    # -- events ----------------------------------------------------------------------------------------------------

    def register_event_handler(self, handler: Any) -> None:
        """Ask it about every event from now on, before those that are there."""
        self._handlers.insert(0, handler)

    def unregister_event_handler(self, handler: Any) -> None:
        """Ask it no more."""
        with suppress(ValueError):
            self._handlers.remove(handler)

    def handlers_of(self, event: Any) -> list[Any]:
        """Those that it concerns."""
        return [handler for handler in self._handlers if handler.matches(event)]

    def emit_event_sync(self, event: Any) -> None:
        """Tell it to the handlers, soon; from any thread."""
        emit: Callable[[Any], None] = self.runner.emit
        emit(event)

    async def emit_event(self, event: Any) -> None:
        """The same for coroutines."""
        self.emit_event_sync(event)
