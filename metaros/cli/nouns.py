"""The table of nouns, loaded when they are used: `metaros topic` imports nothing of `metaros up`.

A noun is a callable `register(app)` that adds commands to a typer app. Ours are in `NOUNS`; other distributions and
packages bring theirs by entry points. A plug-in that cannot be imported takes only itself down.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator, MutableMapping
from dataclasses import dataclass
from functools import partial
from importlib.metadata import entry_points
from typing import Any

import typer

__all__ = ["NOUNS", "Noun", "NounCommands"]

GROUP = "metaros.cli"


@dataclass(frozen=True, slots=True)
class Noun:
    """A top-level command: its name, the module whose `register` makes it, and its panel in the help."""

    name: str
    module: str
    panel: str
    extra: str = ""  # the extra of the distribution that it needs


SYSTEM = "The whole system"
GRAPH = "The ROS graph (ros2's grammar)"
ROBOTS = "Robots and data"
PLUGINS = "Plug-ins"

NOUNS = (
    Noun("up", "metaros.cli.up", SYSTEM, "up"),
    Noun("status", "metaros.cli.status", SYSTEM),
    Noun("doctor", "metaros.cli.doctor", SYSTEM),
    Noun("topic", "metaros.cli.topic", GRAPH),
    Noun("node", "metaros.cli.node", GRAPH),
    Noun("service", "metaros.cli.service", GRAPH),
    Noun("interface", "metaros.cli.interface", GRAPH),
    Noun("sim", "metaros.cli.sim", ROBOTS),
    Noun("play", "metaros.cli.play", ROBOTS),
    Noun("driver", "metaros.cli.driver", ROBOTS, "drivers"),
    Noun("router", "metaros.cli.router", SYSTEM),
)

# What our own distribution brings by entry points: where it stands in the help, and what it needs.
OWN_PLUGINS = {"agent": Noun("agent", "", SYSTEM, "agent"), "gateway": Noun("gateway", "", SYSTEM, "gateway")}

ORDER = ("up", "status", "doctor", "router", "agent", "gateway")


class NounCommands(MutableMapping[str, Any]):
    """Name to click command, each made at its first use."""

    def __init__(self) -> None:
        self._loaders: dict[str, Callable[[], Any]] = {}
        self._made: dict[str, Any] = {}
        found = {point.name: point for point in entry_points(group=GROUP)}
        own = {noun.name: noun for noun in NOUNS}
        names = [*ORDER, *own, *found]
        for name in dict.fromkeys(names):
            if name in own:
                self._loaders[name] = partial(_make, own[name], partial(_own_register, own[name]))
            elif name in found:
                noun = OWN_PLUGINS.get(name, Noun(name, found[name].value, PLUGINS))
                self._loaders[name] = partial(_make, noun, found[name].load)

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


def _own_register(noun: Noun) -> Any:
    return importlib.import_module(noun.module).register


def _make(noun: Noun, load: Callable[[], Any]) -> Any:
    app = typer.Typer(add_completion=False)
    app.callback()(lambda: None)  # so that one command stays a command with a name
    try:
        load()(app)
        command: Any = typer.main.get_group(app).commands[noun.name]
    except Exception as error:  # any fault of a plug-in is that noun's fault only
        command = _broken(noun, error)
    command.rich_help_panel = noun.panel
    return command


def _broken(noun: Noun, error: Exception) -> Any:
    """A command that says in one line why the noun is missing."""
    reason = _reason(noun, error)
    app = typer.Typer(add_completion=False)

    @app.command(
        noun.name,
        help=f"Not available: {reason}.",
        context_settings={"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []},
    )
    def unavailable() -> None:
        sys.stderr.write(f"metaros {noun.name} is not available: {reason}\n")
        raise typer.Exit(2)

    return typer.main.get_command(app)


def _reason(noun: Noun, error: Exception) -> str:
    if isinstance(error, ModuleNotFoundError):
        extra = f"; install it with: pip install 'metaros[{noun.extra}]'" if noun.extra else ""
        return f"it needs the Python module {error.name}{extra}"
    return f"{type(error).__name__}: {error}".splitlines()[0]
