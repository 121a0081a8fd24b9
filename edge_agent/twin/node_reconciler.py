"""Reconciles parameters and lifecycle states of the robot's other nodes with the twin.

A node that is not there yet is seen to when it comes, and again after each of its starts. What a node refuses is
reported by name and not asked again in the same life of the node; a node that does not answer is asked again. What the
twin no longer names gets back what it was before the twin changed it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from edge_agent.errors import DiskError
from edge_agent.forwarding.scope import Scope
from edge_agent.twin.initial_values import InitialValues, NodeInitialValues
from edge_agent.twin.lifecycle import next_step
from edge_agent.twin.services import NodeServices
from metaros.errors import MetarosError, ParameterError, UnavailableError
from metaros.limits import LIMITS
from metaros.node.parameters import SetResult
from metaros.node.parameters.values import fit, infer, kind_of

__all__ = ["NodeReconciler"]

LOG = logging.getLogger("metaros.agent.twin")
RETRY_S: Final = 5.0
STEPS: Final = 4  # from one end of a lifecycle to the other
Values = Mapping[str, Any]


@dataclass(slots=True)
class _Node:
    """What is wanted of one node, and what came of it."""

    parameters: Values | None = None
    lifecycle: str = ""
    life: str = ""  # the one that was seen to
    done: bool = False
    values: dict[str, Any] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    state: str = ""
    trouble: str = ""
    again: tuple[str, float] = ("", 0.0)  # the life that failed, and when it is asked again, by the loop's time

    @property
    def idle(self) -> bool:
        """Nothing is wanted of it."""
        return self.parameters is None and not self.lifecycle


class NodeReconciler:
    """`want` sets the desired state; `run` reconciles. On the event loop."""

    def __init__(self, services: NodeServices, scope: Scope, initial_values: InitialValues) -> None:
        self.changed: Callable[[], object] = lambda: None
        self._services = services
        self._scope = scope
        self._initial_values = initial_values
        self._nodes: dict[str, _Node] = {}
        self._wake = asyncio.Event()
        self._turns = asyncio.Semaphore(LIMITS.twin_services_at_once)
        self._tasks: set[asyncio.Task[None]] = set()
        self._busy: set[str] = set()  # nodes that are being seen to

    def want(self, parameters: Mapping[str, Values] | None, lifecycle: Mapping[str, str] | None) -> None:
        """What is wanted from now on, by node, relative names being below the robot's namespace."""
        wanted: dict[str, _Node] = {}
        for name, values in (parameters or {}).items():
            wanted.setdefault(self._full(name), _Node()).parameters = values
        for name, state in (lifecycle or {}).items():
            wanted.setdefault(self._full(name), _Node()).lifecycle = state
        for name in self._initial_values.nodes:
            wanted.setdefault(name, _Node())
        for name, node in wanted.items():
            known = self._nodes.get(name)
            if known is not None and (known.parameters, known.lifecycle) == (node.parameters, node.lifecycle):
                wanted[name] = known
        self._nodes = wanted
        self._wake.set()
        self.changed()

    def reported(self) -> dict[str, Any]:
        """Sections `parameters` and `lifecycle`: of each node what is set, what it refuses, what it waits for."""
        parameters: dict[str, Any] = {}
        lifecycle: dict[str, Any] = {}
        for name, node in self._nodes.items():
            trouble = {"message": node.trouble} if node.trouble else {}
            if node.parameters is not None:
                refused = {key: text for key, text in node.refused.items() if key}
                state = "waiting" if not node.done else "refused" if refused else "applied"
                parameters[name] = {"state": state, "values": node.values, "refused": refused, **trouble}
            if node.lifecycle:
                refusal = {"message": node.refused[""]} if "" in node.refused else trouble
                lifecycle[name] = {"state": node.state, "wanted": node.lifecycle, **refusal}
        return {"parameters": parameters, "lifecycle": lifecycle}

    async def run(self) -> None:
        """See to it, for ever."""
        loop = asyncio.get_running_loop()
        stop = self._services.on_change(lambda: _soon(loop, self._wake))
        try:
            while True:
                self._wake.clear()
                waiting = self._look()
                try:
                    async with asyncio.timeout(RETRY_S if waiting else None):
                        await self._wake.wait()
                except TimeoutError:
                    continue
        finally:
            stop()
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def _full(self, name: str) -> str:
        return name if name.startswith("/") else f"{self._scope.namespace.rstrip('/')}/{name}"

    def _look(self) -> bool:
        """Begin what can be done now; whether some node that is there has to be asked again."""
        if not self._nodes:
            return False
        lives, waiting, now_s = self._services.lives(), False, asyncio.get_running_loop().time()
        for name, node in self._nodes.items():
            if not self._scope.includes(name):
                _outside(node)
                continue
            life = lives.get(name, "")
            if not life:
                node.done, node.life = False, ""
                continue
            if node.done and node.life == life:
                continue
            waiting = True
            failed, again_s = node.again  # our own clients are changes of the graph, too: they must not hurry us
            if name not in self._busy and (failed != life or now_s >= again_s):
                self._busy.add(name)
                task = asyncio.get_running_loop().create_task(self._see_to(name, node, life))
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
        return waiting

    async def _see_to(self, name: str, node: _Node, life: str) -> None:
        """One node, once."""
        original = self._initial_values.of(name, life)
        try:
            async with self._turns:
                node.values, node.refused = {}, {}
                await self._parameters(name, node, original)
                await self._lifecycle(name, node, original)
            self._same_life(name, original)
            await self._initial_values.keep()
            node.done, node.life, node.trouble = True, life, ""
            if node.idle and not (original.parameters or original.lifecycle):
                self._initial_values.nodes.pop(name, None)
        except MetarosError as error:
            node.done, node.trouble = False, str(error)
            node.again = (life, asyncio.get_running_loop().time() + RETRY_S)
        except Exception as error:
            LOG.exception("node %s", name)
            node.done, node.life, node.trouble = True, life, f"{type(error).__name__}: {error}"
        finally:
            self._busy.discard(name)
            self.changed()
        if node.done or self._nodes.get(name) is not node:
            self._wake.set()  # something else may be wanted of it by now

    async def _parameters(self, name: str, node: _Node, original: NodeInitialValues) -> None:
        wanted = node.parameters or {}
        back = [key for key in original.parameters if key not in wanted]
        if not wanted and not back:
            return
        now = await self._services.get(name, [*wanted, *back])
        setting: dict[str, Any] = {key: original.parameters[key] for key in back}
        fresh: set[str] = set()  # values that the twin had not changed until now
        for key, value in wanted.items():
            try:
                fitting = infer(value) if now.get(key) is None else fit(value, kind_of(now[key]))
            except ParameterError as error:
                node.refused[key] = str(error)
                continue
            if fitting == now.get(key):
                node.values[key] = fitting
                continue
            setting[key] = fitting
            if key not in original.parameters or original.guessed:
                original.parameters[key] = now.get(key)
                fresh.add(key)
        if setting:
            await self._keep(original, fresh)
            results = await self._services.set(name, setting)
            for key, value in setting.items():
                if not _note(node, key, value, results.get(key)) and key in fresh:
                    original.parameters.pop(key, None)
            for key in back:  # as it was, or as far as the node lets it
                original.parameters.pop(key, None)

    def _same_life(self, name: str, original: NodeInitialValues) -> None:
        """A node that was started again meanwhile may have been changed in either life: the next one has the values
        of the same start, so that what is known of them goes on.
        """
        life = self._services.lives().get(name, "")
        if life and life != original.life:
            self._initial_values.nodes[name] = replace(original, life=life, guessed=True)
            raise UnavailableError(f"{name} was started again meanwhile")

    async def _keep(self, original: NodeInitialValues, fresh: set[str]) -> None:
        """Before the first change."""
        try:
            await self._initial_values.keep()
        except DiskError:
            for key in fresh:
                original.parameters.pop(key, None)
            raise

    async def _lifecycle(self, name: str, node: _Node, original: NodeInitialValues) -> None:
        goal = node.lifecycle or original.lifecycle
        if not goal:
            return
        node.state = await self._services.state(name)
        if node.lifecycle and not original.lifecycle:
            original.lifecycle = node.state
            await self._initial_values.keep()
        for _ in range(STEPS):
            step = next_step(node.state, goal)
            if step is None:
                break
            taken = await self._services.change(name, step)
            node.state = await self._services.state(name)
            if not taken:
                break
        if node.state != goal:
            node.refused[""] = f"it stays {node.state}, {goal} is wanted"
        if not node.lifecycle:
            original.lifecycle = ""


def _note(node: _Node, key: str, value: Any, result: SetResult | None) -> bool:
    """What a node said to one value; whether it took it."""
    taken = result is not None and result.successful
    if node.parameters is not None and key in node.parameters:
        if taken:
            node.values[key] = value
        else:
            node.refused[key] = (result.reason if result is not None else "") or "the node refused it"
    return taken


def _outside(node: _Node) -> None:
    node.done, node.trouble = True, "outside the robot's namespace"


def _soon(loop: asyncio.AbstractEventLoop, wake: asyncio.Event) -> None:
    """From a Zenoh thread."""
    try:
        loop.call_soon_threadsafe(wake.set)
    except RuntimeError:  # the loop is closed: the program ends
        return
