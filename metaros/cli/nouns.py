"""The table of nouns, loaded when they are used: `metaros topic` imports nothing of `metaros up`.

A noun is a callable `register(app)` that adds commands to a typer app. Ours are in `NOUNS`; other distributions and
packages bring theirs by entry points. A plug-in that cannot be imported takes only itself down.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator, MutableMapping
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import typer

__all__ = ["NOUNS", "Noun", "NounCommands", "plug_ins"]

GROUP = "metaros.cli"
SYSTEM = "The whole system"
GRAPH = "The ROS graph, in ros2's grammar"
ROBOTS = "Robots and data"
PLUGINS = "Plug-ins"


@dataclass(frozen=True, slots=True)
class Noun:
    """A top-level command: its name, the module whose `register` makes it, and its line in the help."""

    name: str
    module: str  # empty: it comes by an entry point
    panel: str
    summary: str
    extra: str = ""  # the extra of the distribution that it needs


NOUNS = (
    Noun(
        "up", "metaros.cli.up.commands", SYSTEM, "Gateway, dashboard, simulated robots and this machine, in one command"
    ),
    Noun("status", "metaros.cli.status", SYSTEM, "What runs, on which ports"),
    Noun("doctor", "metaros.cli.doctor.commands", SYSTEM, "Check every hop; name the one that fails, and the fix"),
    Noun("launch", "metaros.cli.launch.commands", SYSTEM, "Keep a table of nodes running: FILE, status, restart, stop"),
    Noun("ros2", "metaros.cli.ros2.commands", SYSTEM, "run, list: programs written for ROS 2, as they are"),
    Noun("supervisor", "metaros.cli.supervisor", SYSTEM, "Keep a robot's nodes running: status, stop"),
    Noun("router", "metaros.cli.router", SYSTEM, "Host the Zenoh router of this machine"),
    Noun("broker", "metaros.cli.broker.commands", SYSTEM, "Bridge ZeroMQ programs, old and new, to ROS topics", "zmq"),
    Noun("dds", "metaros.cli.dds.commands", SYSTEM, "Bridge robots on DDS to ROS topics and services", "dds"),
    Noun("agent", "", SYSTEM, "A robot's agent: forward its topics to a gateway", "agent"),
    Noun("agent-slot", "", SYSTEM, "The same in the version that updates have brought; taken back when bad", "agent"),
    Noun("gateway", "", SYSTEM, "The gateway: agents' link, API, dashboard", "gateway"),
    Noun("signin", "", SYSTEM, "A link that signs a browser in once", "gateway"),
    Noun("context", "metaros.cli.context", SYSTEM, "list, add, use, show, remove: gateways by name"),
    Noun("user", "", SYSTEM, "add, list, change, password, remove: who may sign in", "gateway"),
    Noun("key", "", SYSTEM, "create, list, revoke: how programs sign in", "gateway"),
    Noun("audit", "", SYSTEM, "list, verify: who changed what, and the proof of that log", "gateway"),
    Noun("ca", "", SYSTEM, "list, rotate, renew, retire: who signs robots' certificates", "gateway"),
    Noun("topic", "metaros.cli.topic.commands", GRAPH, "list, info, type, find, echo, hz, bw, delay, pub"),
    Noun("node", "metaros.cli.node", GRAPH, "list, info; of robots: start, stop, log, set, param, lifecycle …"),
    Noun("service", "metaros.cli.service", GRAPH, "list, info, type, find, call"),
    Noun("param", "metaros.cli.param.commands", GRAPH, "list, get, set, describe, dump, load, delete"),
    Noun("action", "metaros.cli.action.commands", GRAPH, "list, info, type, find, send_goal"),
    Noun("lifecycle", "metaros.cli.lifecycle", GRAPH, "nodes, get, list, set: managed nodes and their states"),
    Noun("interface", "metaros.cli.interface", GRAPH, "list, show, proto, hash: message, service and action types"),
    Noun("top", "metaros.cli.top.commands", GRAPH, "Nodes and topics with their rates, live"),
    Noun("graph", "metaros.cli.graph.commands", GRAPH, "Who talks to whom, and who cannot: a tree, or a drawing"),
    Noun("sim", "metaros.cli.sim", ROBOTS, "Simulated robots in a small warehouse"),
    Noun("bag", "metaros.cli.bag.commands", ROBOTS, "record, info, play, cut, export, save, recover: MCAP recordings"),
    Noun("play", "metaros.cli.play", ROBOTS, "Replay a recording, or a real robot's log, as live topics"),
    Noun("robot", "", ROBOTS, "list, token, identities, label, revoke: which robots belong to the fleet", "gateway"),
    Noun("twin", "", ROBOTS, "show, set, patch, diff, history, revert, template: what robots are to be", "gateway"),
    Noun("command", "", ROBOTS, "send, list, show, cancel: what robots are told to do, and what came of it", "gateway"),
    Noun("update", "", ROBOTS, "init-root, add, sign, publish, list, withdraw: signed versions for robots", "gateway"),
    Noun("rollout", "", ROBOTS, "start, show, pause, resume, abort: a version for many robots, in waves", "gateway"),
    Noun("alert", "", ROBOTS, "list, show, ack, silence, normal, backtest …: what is wrong, and why", "gateway"),
    Noun(
        "function",
        "",
        ROBOTS,
        "init, test, deploy, invoke, logs …: programs that run when something happens",
        "gateway",
    ),
    Noun("rule", "", ROBOTS, "put, list, dry-run, hook, events …: what is done when something happens", "gateway"),
    Noun("recording", "", ROBOTS, "list, save, get, delete: the last minutes of a robot, in full", "gateway"),
    Noun("history", "", ROBOTS, "topics, messages, export: what a gateway has stored", "gateway"),
    Noun("anomaly", "", ROBOTS, "score: what is unusual in a file of samples", "gateway"),
    Noun("seal", "metaros.cli.seal", ROBOTS, "key, open: sealed topics, which the gateway cannot read"),
    Noun("driver", "metaros.cli.driver.commands", ROBOTS, "list, probe, info, run, new: cameras and other devices"),
)


@cache
def plug_ins() -> tuple[EntryPoint, ...]:
    """What distributions bring: to find them costs a file each."""
    return tuple(entry_points(group=GROUP))


class NounCommands(MutableMapping[str, Any]):
    """Name to click command, each made at its first use."""

    def __init__(self) -> None:
        self._made: dict[str, Any] = {}
        self._loaders: dict[str, Callable[[], Any]] = {}
        self.table: dict[str, Noun] = {}  # for the help, which loads nothing
        found = {point.name: point for point in plug_ins()}
        for noun in NOUNS:
            if noun.module or noun.name in found:
                self._add(noun, found.get(noun.name))
        for point in found.values():
            if point.name not in self.table:
                self._add(Noun(point.name, "", PLUGINS, f"from {point.value.split(':')[0]}"), point)

    def _add(self, noun: Noun, point: EntryPoint | None) -> None:
        self.table[noun.name] = noun
        self._loaders[noun.name] = partial(_make, noun, point)

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            self._made[name] = self._loaders[name]()
        return self._made[name]

    def __setitem__(self, name: str, command: Any) -> None:
        self._loaders[name] = lambda: command
        self._made.pop(name, None)

    def __delitem__(self, name: str) -> None:
        del self._loaders[name]
        self._made.pop(name, None)

    def __iter__(self) -> Iterator[str]:
        return iter(self._loaders)

    def __len__(self) -> int:
        return len(self._loaders)

    def __contains__(self, name: object) -> bool:
        return name in self._loaders


@cache
def _make(noun: Noun, point: EntryPoint | None) -> Any:
    """The command, once a process: a noun of twenty commands takes a tenth of a second."""
    app = typer.Typer(add_completion=False)
    app.callback()(lambda: None)  # so that one command stays a command with a name
    try:
        register = importlib.import_module(noun.module).register if point is None or noun.module else point.load()
        register(app)
        return typer.main.get_group(app).commands[noun.name]
    except Exception as error:  # any fault of a plug-in is that noun's fault only
        return _broken(noun, error)


def _broken(noun: Noun, error: Exception) -> Any:
    """A command that says in one line why the noun is missing."""
    reason = _reason(noun, error)
    app = typer.Typer(add_completion=False)
    settings = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []}

    @app.command(noun.name, help=noun.summary, context_settings=settings)
    def unavailable() -> None:
        sys.stderr.write(f"error: metaros {noun.name} is not available: {reason}\n")
        raise typer.Exit(2)

    return typer.main.get_command(app)


def _reason(noun: Noun, error: Exception) -> str:
    if isinstance(error, ModuleNotFoundError):
        extra = f"; install it with: pip install 'metaros[{noun.extra}]'" if noun.extra else ""
        return f"it needs the Python module {error.name}{extra}"
    return f"{type(error).__name__}: {error}".splitlines()[0]
