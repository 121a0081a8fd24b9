"""Probes around a node's callbacks: when each ran, for how long, and whether it failed. Thread-safe."""

from __future__ import annotations

import functools
import inspect
import threading
from collections.abc import Callable
from typing import Any

from metaros.clock import Clock

__all__ = ["ANY", "Probe", "Probes"]

ANY = ""  # the probe of all callbacks


class Probe:
    """The listeners of one callback name. `callbacks` is how many bear the name; without any nothing is measured."""

    def __init__(self) -> None:
        self.callbacks = 0
        self.starts: list[Callable[[float], None]] = []
        self.durations: list[Callable[[float, float], None]] = []


class Probes:
    """All probes of a node. Listeners are called under `lock`; so must they be read."""

    def __init__(self, clock: Clock) -> None:
        self.lock = threading.Lock()
        self.errors: list[Callable[[float], None]] = []
        self._now = clock.monotonic_s
        self._by_name: dict[str, Probe] = {ANY: Probe()}

    def named(self, name: str) -> Probe:
        """The probe of a name, made on first use."""
        return self._by_name.setdefault(name, Probe())

    def error(self) -> None:
        """Something failed."""
        now_s = self._now()
        with self.lock:
            for listener in self.errors:
                listener(now_s)

    def around(self, name: str, callback: Callable[..., Any]) -> Callable[..., Any]:
        """The callback with its probe: the same arguments, results and exceptions."""
        probe, every, now = self.named(name), self._by_name[ANY], self._now
        probe.callbacks += 1

        if inspect.iscoroutinefunction(callback):

            @functools.wraps(callback)
            async def measured_async(*arguments: Any) -> Any:
                begun_s = now()
                self._begin(probe, begun_s)
                try:
                    return await callback(*arguments)
                except Exception:
                    self.error()
                    raise
                finally:
                    self._end(probe, begun_s)

            return measured_async

        @functools.wraps(callback)
        def measured(*arguments: Any) -> Any:
            if not (probe.starts or probe.durations or every.durations or self.errors):
                return callback(*arguments)
            begun_s = now()
            self._begin(probe, begun_s)
            try:
                return callback(*arguments)
            except Exception:
                self.error()
                raise
            finally:
                self._end(probe, begun_s)

        return measured

    def _begin(self, probe: Probe, now_s: float) -> None:
        if probe.starts:
            with self.lock:
                for listener in probe.starts:
                    listener(now_s)

    def _end(self, probe: Probe, begun_s: float) -> None:
        listeners = [*probe.durations, *self._by_name[ANY].durations]
        if listeners:
            now_s = self._now()
            with self.lock:
                for listener in listeners:
                    listener(now_s, now_s - begun_s)
