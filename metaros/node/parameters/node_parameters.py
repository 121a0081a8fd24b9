"""`node.parameters`: the node's parameters as a mapping with rules, thread-safe, with change notifications."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from metaros.errors import ParameterError
from metaros.node.parameters.descriptor import ParameterDescriptor, Range, Validate
from metaros.node.parameters.store import Change, Outcome, ParameterStore
from metaros.node.parameters.values import ParameterType, Value, as_parameter_type, infer, kind_of

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["NodeParameters"]

F = TypeVar("F", bound=Callable[..., Any])
Names = list[str]
PostSet = Callable[[dict[str, Any]], object]
_log = logging.getLogger("metaros.node")


class NodeParameters:
    """Declared parameters by name. Reading never waits; sets are checked one at a time.

    Callbacks run on the thread that sets: for a remote set that is the executor's. Those of `on_change` and the
    post-set ones may set parameters themselves; what they raise is logged.
    """

    def __init__(
        self,
        node_name: str,
        *,
        overrides: Mapping[str, Any] | None = None,
        allow_undeclared: bool = False,
    ) -> None:
        self.node_name = node_name
        self.store = ParameterStore(overrides=overrides, allow_undeclared=allow_undeclared)
        self.notify: Callable[[Sequence[Change]], None] = lambda _changes: None  # /parameter_events, once it is served
        self._post_set: list[PostSet] = []
        self._lock = threading.RLock()

    # -- declaring -------------------------------------------------------------------------------------------------

    def declare(
        self,
        name: str,
        default: object = None,
        *,
        parameter_type: object = None,
        description: str = "",
        minimum: float | None = None,
        maximum: float | None = None,
        step: float = 0,
        choices: Sequence[Any] = (),
        read_only: bool = False,
        dynamic_typing: bool = False,
        validate: Validate | None = None,
        ignore_override: bool = False,
    ) -> Any:
        """Add a parameter and return its value: the override that the node was created with, else the default.

        Its type is the default's, or `parameter_type` (`float`, `list[int]`, `ParameterType.DOUBLE`).
        `validate(value)` refuses by raising, by returning False or by returning the reason.
        """
        kind = _kind(name, default, parameter_type, dynamic_typing=dynamic_typing)
        descriptor = ParameterDescriptor(
            name=name,
            kind=kind,
            description=description,
            read_only=read_only,
            dynamic_typing=dynamic_typing,
            range=_range(kind, minimum, maximum, step),
            choices=tuple(choices),
            validate=validate,
        )
        with self._lock:
            change = self.store.declare(descriptor, default, ignore_override=ignore_override)
            self.notify([change])
        return change.value

    def undeclare(self, name: str) -> None:
        """Remove a parameter that is not read-only."""
        with self._lock:
            self.notify([self.store.undeclare(name)])

    # -- reading ---------------------------------------------------------------------------------------------------

    def __getitem__(self, name: str) -> Any:
        return self.store.get(name)

    def __contains__(self, name: object) -> bool:
        return name in self.store

    def __iter__(self) -> Iterator[str]:
        return iter(self.store.names())

    def __len__(self) -> int:
        return len(self.store)

    def get(self, name: str, default: Any = None) -> Any:
        """The value, or `default` where the parameter is not declared or has no value."""
        entry = self.store.entry(name)
        return default if entry is None or entry.value is None else self.store.get(name)

    def describe(self, name: str) -> ParameterDescriptor:
        """Its type and rules; UnknownParameterError unless it is declared."""
        return self.store.describe(name)

    def list(self, prefix: str = "", depth: int = 0) -> Names:
        """Names, or those below `prefix` (`motor` for `motor.speed`), at most `depth` levels deep (0: any)."""
        return self.store.list((prefix,) if prefix else (), depth)[0]

    def values(self) -> dict[str, Any]:
        """All values by name."""
        return {name: self.store.get(name) for name in self.store.names()}

    # -- setting ---------------------------------------------------------------------------------------------------

    def __setitem__(self, name: str, value: object) -> None:
        self.set(name, value)

    def set(self, name: str, value: object) -> None:
        """Set one; ParameterError says why it is refused. A whole number is taken for a double."""
        self.set_atomically({name: value})

    def set_atomically(self, values: Mapping[str, Any]) -> None:
        """Set all of them or none; ParameterError has a reason for each one that is refused."""
        self.try_set(values).check()

    def try_set(self, values: Mapping[str, Any], *, exact: bool = False) -> Outcome:
        """As `set_atomically`, but returns the outcome; `exact` converts no numbers, as on the wire."""
        with self._lock:
            try:
                outcome = self.store.set_atomically(values, exact=exact)
            except ParameterError as error:  # from within a check
                return Outcome(reasons={"": str(error)})
            if outcome.changes:
                self.notify(outcome.changes)
        if outcome.changes:
            self._announce(outcome.changes)
        return outcome

    # -- callbacks -------------------------------------------------------------------------------------------------

    def on_change(self, name: str = "") -> Callable[[F], F]:
        """Decorate `callback(value)`, called when the parameter has changed; without a name `callback(name, value)`."""

        def decorate(callback: F) -> F:
            self._post_set.append(lambda changed: _each(callback, name, changed))
            return callback

        return decorate

    def add_pre_set_callback(self, callback: F) -> F:
        """Call `callback(values)` before a set; what it returns, unless None, is set instead."""
        self.store.pre_set.append(callback)
        return callback

    def add_on_set_callback(self, callback: F) -> F:
        """Call `callback(values)` with values that fit: to refuse them it raises, or returns False or the reason."""
        self.store.on_set.append(callback)
        return callback

    def add_post_set_callback(self, callback: F) -> F:
        """Call `callback(values)` after a set, with what has another value now."""
        self._post_set.append(callback)
        return callback

    def _announce(self, changes: Sequence[Change]) -> None:
        changed = {c.name: c.value for c in changes if c.what != "deleted" and c.value != c.before}
        for callback in list(self._post_set) if changed else ():
            try:
                callback({name: _copy(value) for name, value in changed.items()})
            except Exception:
                _log.exception("a parameter callback of %s failed", self.node_name)

    # -- files -----------------------------------------------------------------------------------------------------

    def dump(self) -> str:
        """All values as a ROS 2 parameter file."""
        from metaros.node.parameters.files import dump_yaml

        return dump_yaml(self.node_name, self.values())

    def load(self, path: str | Path) -> None:
        """Set what a ROS 2 parameter file says of this node, all or nothing."""
        from metaros.node.parameters.files import load_file

        self.set_atomically(load_file(path, self.node_name))


def _kind(name: str, default: object, parameter_type: object, *, dynamic_typing: bool) -> ParameterType:
    if parameter_type is not None:
        return as_parameter_type(parameter_type)
    try:
        value = infer(default)
    except ParameterError as error:
        raise ParameterError(f"{name}: {error}") from None
    if value == [] and not dynamic_typing:
        raise ParameterError(f"{name}: an empty list does not tell its type: give a parameter_type")
    return kind_of(value)


def _range(kind: ParameterType, minimum: float | None, maximum: float | None, step: float) -> Range | None:
    if minimum is None and maximum is None and not step:
        return None
    if kind is ParameterType.INTEGER:
        low = -(1 << 63) if minimum is None else minimum
        return Range(low, (1 << 63) - 1 if maximum is None else maximum, step)
    return Range(float("-inf") if minimum is None else minimum, float("inf") if maximum is None else maximum, step)


def _each(callback: Callable[..., Any], wanted: str, changed: Mapping[str, Any]) -> None:
    for name, value in changed.items():
        if not wanted:
            callback(name, value)
        elif name == wanted:
            callback(value)


def _copy(value: Value) -> Value:
    return list(value) if isinstance(value, list) else value  # type: ignore[return-value]
