"""`rclpy.Context`: from `init` to `shutdown`, with the library's own context behind it, opened when a node needs it."""

from __future__ import annotations

import os
import threading
import weakref
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from types import MethodType
from typing import Any

from metaros.errors import MetarosError, NameError_
from metaros.node.arguments import RosArguments
from metaros.node.context import Context as NativeContext
from metaros.ros2.rclpy.core.destroyable import Destroyable
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle, RCLError
from metaros.ros2.rclpy.core.ros_arguments import parse_arguments
from metaros.ros2.rclpy.logging.state import configure
from metaros.wire.keys import parse_domain
from metaros.wire.session import domain_from

__all__ = ["Context", "ContextHandle", "living_contexts"]

_living: weakref.WeakSet[Context] = weakref.WeakSet()


class ContextHandle(Destroyable, NativeContext):
    """The library's context behind an rclpy one. `with` keeps it from being destroyed; it does not close it."""

    def ok(self) -> bool:
        """Whether nodes can live in it."""
        return not self.closed

    def get_domain_id(self) -> int:
        """The ROS domain."""
        return self.domain_id

    def shutdown(self) -> None:
        """Close it with its nodes."""
        self.close()


class Context:
    """What nodes share between `init` and `shutdown`: a domain, the command line, one session. Not to be used again.

    A signal ends it, too, where its handler is installed: `ok()` is False from then on, and `shutdown` cleans up.
    `handle` is the library's own context; the session is opened by who first asks for it.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._callbacks: list[Callable[[], Callable[[], object] | None]] = []
        self._wakers: dict[object, Callable[[], object]] = {}
        self._nodes: list[weakref.ref[Any]] = []
        self._doomed: deque[Any] = deque()
        self._handle: ContextHandle | None = None
        self._arguments: RosArguments | None = None  # from init on
        self._domain = 0
        self._over = False  # by a signal or by shutdown
        self._shut = False  # by shutdown

    # -- life ------------------------------------------------------------------------------------------------------

    def init(
        self,
        args: Sequence[str] | None = None,
        *,
        initialize_logging: bool = True,
        domain_id: int | None = None,
    ) -> None:
        """Begin; `args` stand in for the process's command line, `domain_id` for ROS_DOMAIN_ID.

        Raises:
            RuntimeError: it was initialised before, or there is no such domain.
            UnknownROSArgsError, RCLInvalidROSArgsError: the command line cannot be read.
        """
        with self._lock:
            if self._arguments is not None:
                raise RuntimeError("Context.init() must only be called once: make another Context")
            try:
                self._domain = domain_from(os.environ) if domain_id is None else parse_domain(str(int(domain_id)))
            except NameError_ as error:
                raise RuntimeError(f"Domain id ({domain_id}) cannot be: {error}") from None
            except MetarosError as error:
                raise RuntimeError(str(error)) from None
            self._arguments = parse_arguments(args)
            if initialize_logging:
                configure(self._arguments)
            _living.add(self)

    @property
    def was_initialized(self) -> bool:
        """Whether `init` was called, whatever came after."""
        return self._arguments is not None

    def ok(self) -> bool:
        """Whether it was initialised and is not shut down."""
        return self._arguments is not None and not self._over

    def shutdown(self) -> None:
        """End it: nodes are destroyed, callbacks of `on_shutdown` called.

        After a signal has ended it this cleans up; rclpy raises there.

        Raises:
            RuntimeError: it was never initialised, or shut down before.
        """
        if self._arguments is None:
            raise RuntimeError("Context must be initialized before it can be shutdown: call init() first")
        if not self._end():
            raise RCLError("failed to shutdown: the context was shut down already; try_shutdown() does not mind")

    def try_shutdown(self) -> None:
        """The same where there is something to shut down, else nothing."""
        if self._arguments is not None:
            self._end()

    def destroy(self) -> None:
        """Free what is left of it."""
        self.try_shutdown()

    def _end(self) -> bool:
        """False where somebody else has ended it, or is about to. Callbacks and nodes may need the lock elsewhere."""
        with self._lock:
            if self._shut:
                return False
            self._shut = self._over = True
            callbacks, self._callbacks = self._callbacks, []
            nodes, self._nodes = self._nodes, []
        _living.discard(self)
        self.wake()
        for reference in callbacks:
            callback = reference()
            if callback is not None:
                callback()
        for node in [reference() for reference in nodes]:
            if node is not None:
                with suppress(InvalidHandle):  # it was destroyed meanwhile
                    node._destroy_with_context()
        if self._handle is not None:
            self._handle.close()
        return True

    def on_shutdown(self, callback: Callable[[], object]) -> None:
        """Call `callback()` at the shutdown; at once where that is over. Bound methods are referred to weakly."""
        if not callable(callback):
            raise TypeError(f"callback should be a callable, got {type(callback)}")
        with self._lock:
            if not self._shut:
                weak = isinstance(callback, MethodType)
                self._callbacks.append(weakref.WeakMethod(callback, self._forget) if weak else lambda: callback)
                return
        callback()

    def _forget(self, reference: Any) -> None:
        with suppress(ValueError):
            self._callbacks.remove(reference)

    def close_soon(self, handle: Any) -> None:
        """Close a node's handle on a thread of the library's; takes no lock."""
        self._doomed.append(handle)

    def _close_doomed(self) -> None:
        while self._doomed:
            self._doomed.popleft().close()

    # -- signals ---------------------------------------------------------------------------------------------------

    def wake_with(self, waker: Callable[[], object]) -> Callable[[], None]:
        """Call `waker()` when the context ends, by a signal too; returns how to stop that.

        It may run in a signal's handler, in the middle of anything: it must take no lock.
        """
        key = object()
        self._wakers[key] = waker

        def stop() -> None:
            self._wakers.pop(key, None)

        return stop

    def _end_by_signal(self) -> None:
        """In a signal's handler: no locks, and no callbacks of programs."""
        self._over = True
        self.wake()

    def wake(self) -> None:
        """Have who waits look around: executors of its nodes, and whoever asked by `wake_with`. Takes no lock."""
        handle = self._handle
        if handle is not None:
            handle.ingress.wake()
        for waker in list(self._wakers.values()):
            waker()

    # -- what nodes need -------------------------------------------------------------------------------------------

    @property
    def handle(self) -> ContextHandle | None:
        """The library's context, opened now if it was not; None before `init`, and where none was ever opened."""
        if self._handle is None and self.ok():
            with self._lock:
                if self._handle is None and self.ok():
                    self._handle = ContextHandle(self._domain)
                    self._handle.ingress.add_chore(self._close_doomed)
        return self._handle

    @property
    def arguments(self) -> RosArguments:
        """What the command line says; RuntimeError before `init`."""
        if self._arguments is None:
            raise RuntimeError("Context must be initialized before it has arguments: call init() first")
        return self._arguments

    def get_domain_id(self) -> int:
        """The ROS domain; RuntimeError before `init`."""
        if self._arguments is None:
            raise RuntimeError("Context must be initialized before it can have a domain id: call init() first")
        return self._domain

    def track_node(self, node: Any) -> None:
        """Destroy this node at the shutdown, if it is still there."""
        with self._lock:
            self._nodes = [reference for reference in self._nodes if reference() is not None]
            self._nodes.append(weakref.ref(node))

    def untrack_node(self, node: Any) -> None:
        """The reverse of `track_node`."""
        with self._lock:
            self._nodes = [reference for reference in self._nodes if reference() not in (None, node)]

    def __enter__(self) -> Context:
        """Initialised, if it was not."""
        if self._arguments is None:
            self.init()
        return self

    def __exit__(self, *_: object) -> None:
        self.try_shutdown()


def living_contexts() -> list[Context]:
    """Those between `init` and `shutdown`."""
    return list(_living)
