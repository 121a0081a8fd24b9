"""The parameters of one node as a pure store: declarations and values in, outcomes out. No I/O, no locks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from metaros.errors import ParameterError, UnknownParameterError
from metaros.limits import LIMITS
from metaros.node.parameters.descriptor import ParameterDescriptor
from metaros.node.parameters.values import ParameterType, Value, kind_of

__all__ = ["Change", "Entry", "Outcome", "ParameterStore", "groups_of", "is_listed"]

SEPARATOR: Final = "."
PreSet = Callable[[dict[str, Any]], Mapping[str, Any] | None]
OnSet = Callable[[dict[str, Any]], object]
Names = list[str]


@dataclass(slots=True)
class Entry:
    """One declared parameter. `value` is None until it is set, which only a typed one without default can be."""

    descriptor: ParameterDescriptor
    value: Value

    @property
    def kind(self) -> ParameterType:
        """The type to tell others: of the value, or the declared one of an empty list."""
        if self.value is None or self.descriptor.dynamic_typing:
            return kind_of(self.value)
        return self.descriptor.kind


@dataclass(frozen=True, slots=True)
class Change:
    """One parameter that came (`new`), went (`deleted`) or was set (`changed`), with the value before."""

    what: str
    name: str
    value: Value
    before: Value
    kind: ParameterType


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a set: changes, or a reason for each parameter that was refused, never both."""

    changes: tuple[Change, ...] = ()
    reasons: Mapping[str, str] = field(default_factory=dict)

    @property
    def successful(self) -> bool:
        """Whether all was set."""
        return not self.reasons

    @property
    def reason(self) -> str:
        """All reasons in one line."""
        return "; ".join(f"{name}: {why}" if name else why for name, why in self.reasons.items())

    def check(self) -> Outcome:
        """Itself; ParameterError with the reasons when it was refused, UnknownParameterError for unknown names only."""
        if self.successful:
            return self
        unknown = all(why == _UNDECLARED for why in self.reasons.values())
        raise (UnknownParameterError if unknown else ParameterError)(self.reason)


_UNDECLARED: Final = "it was not declared"


class ParameterStore:
    """Declared parameters and their values.

    `overrides` replace the defaults of what is declared later. With `allow_undeclared` a set of an unknown name
    declares it, with dynamic typing. Values go in and come out as copies.
    """

    def __init__(self, *, overrides: Mapping[str, Any] | None = None, allow_undeclared: bool = False) -> None:
        self.overrides: dict[str, Any] = dict(overrides or {})
        self.allow_undeclared = allow_undeclared
        self.pre_set: list[PreSet] = []
        self.on_set: list[OnSet] = []
        self._entries: dict[str, Entry] = {}
        self._checking = False

    # -- declaring -------------------------------------------------------------------------------------------------

    def declare(self, descriptor: ParameterDescriptor, default: object, *, ignore_override: bool = False) -> Change:
        """Add a parameter with its default or its override; ParameterError when it exists or does not fit itself."""
        name = descriptor.name
        if name in self._entries:
            raise ParameterError(f"{name} was declared before")
        if len(self._entries) >= LIMITS.parameters_per_node:
            raise ParameterError(f"a node takes {LIMITS.parameters_per_node} parameters, {name} would be one more")
        overridden = name in self.overrides and not ignore_override
        given = self.overrides[name] if overridden else default
        try:
            value = None if given is None else descriptor.accept(given)
        except ParameterError as error:
            raise ParameterError(f"{name}: {'override' if overridden else 'default'}: {error}") from error
        entry = self._entries[name] = Entry(descriptor, value)
        return Change("new", name, value, None, entry.kind)

    def undeclare(self, name: str) -> Change:
        """Remove a parameter; read-only ones stay."""
        entry = self._entry(name)
        if entry.descriptor.read_only:
            raise ParameterError(f"{name}: it is read-only and stays")
        del self._entries[name]
        return Change("deleted", name, None, entry.value, ParameterType.NOT_SET)

    # -- reading ---------------------------------------------------------------------------------------------------

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __len__(self) -> int:
        return len(self._entries)

    def names(self) -> Names:
        """All names, in the order of their declaration."""
        return list(self._entries)

    def get(self, name: str) -> Value:
        """The value; UnknownParameterError unless it is declared."""
        value = self._entry(name).value
        return list(value) if isinstance(value, list) else value  # type: ignore[return-value]

    def entry(self, name: str) -> Entry | None:
        """The parameter with its rules; None unless it is declared."""
        return self._entries.get(name)

    def describe(self, name: str) -> ParameterDescriptor:
        """Its rules; UnknownParameterError unless it is declared."""
        return self._entry(name).descriptor

    def _entry(self, name: str) -> Entry:
        entry = self._entries.get(name)
        if entry is None:
            raise UnknownParameterError(f"{name}: {_UNDECLARED}")
        return entry

    def list(self, prefixes: Sequence[str] = (), depth: int = 0) -> tuple[Names, Names]:
        """Names below the prefixes (all without one) at most `depth` levels deep (0: any), and the groups they are in.

        As in ROS 2, levels are counted below each prefix, and a prefix that is a whole name stands for itself.
        """
        names = [name for name in self._entries if is_listed(name, prefixes, depth)]
        return names, groups_of(names)

    # -- setting ---------------------------------------------------------------------------------------------------

    def set_atomically(self, values: Mapping[str, Any], *, exact: bool = False) -> Outcome:
        """Set all of them or none. None as a value deletes a parameter that is dynamically typed.

        `exact` takes only values of the very type, as on the wire. Pre-set callbacks may change what is set, on-set
        callbacks may refuse it; setting from within either is refused.
        """
        if self._checking:
            raise ParameterError("parameters cannot be set while a set is being checked")
        self._checking = True
        try:
            return self._set(dict(values), exact=exact)
        finally:
            self._checking = False

    def _set(self, values: dict[str, Any], *, exact: bool) -> Outcome:
        for pre in self.pre_set:
            try:
                replaced = pre(dict(values))
            except Exception as error:
                return Outcome(reasons={"": str(error) or type(error).__name__})
            values = values if replaced is None else dict(replaced)
        accepted: dict[str, tuple[ParameterDescriptor, Value]] = {}
        reasons: dict[str, str] = {}
        for name, value in values.items():
            try:
                descriptor = self._settable(name, value)
                accepted[name] = (descriptor, None if value is None else descriptor.accept(value, exact=exact))
            except ParameterError as error:
                reasons[name] = str(error)
        reasons = reasons or self._refusals({name: value for name, (_, value) in accepted.items()})
        if not reasons and len(accepted.keys() | self._entries.keys()) > LIMITS.parameters_per_node:
            reasons = {"": f"a node takes {LIMITS.parameters_per_node} parameters"}
        if reasons:
            return Outcome(reasons=reasons)
        return Outcome(tuple(self._apply(name, *item) for name, item in accepted.items()))

    def _settable(self, name: str, value: object) -> ParameterDescriptor:
        entry = self._entries.get(name)
        if entry is None:
            if self.allow_undeclared and value is not None:
                return ParameterDescriptor(name=name, dynamic_typing=True)
            raise ParameterError(_UNDECLARED)
        if entry.descriptor.read_only:
            raise ParameterError("it is read-only")
        if value is None and not entry.descriptor.dynamic_typing:
            raise ParameterError("it is statically typed and cannot be deleted")
        return entry.descriptor

    def _refusals(self, values: dict[str, Any]) -> dict[str, str]:
        for check in self.on_set:
            try:
                verdict = check(dict(values))
            except Exception as error:
                return {"": str(error) or type(error).__name__}
            if verdict is False or (isinstance(verdict, str) and verdict):
                return {"": verdict or "refused by a callback"}
        return {}

    def _apply(self, name: str, descriptor: ParameterDescriptor, value: Value) -> Change:
        entry = self._entries.get(name)
        before = None if entry is None else entry.value
        if value is None:
            del self._entries[name]
            return Change("deleted", name, None, before, ParameterType.NOT_SET)
        fresh = self._entries[name] = Entry(descriptor, value)
        return Change("new" if entry is None else "changed", name, value, before, fresh.kind)


def groups_of(names: Iterable[str]) -> Names:
    """The groups that parameters of these names are in."""
    return list(dict.fromkeys(filter(None, (name.rpartition(SEPARATOR)[0] for name in names))))


def is_listed(name: str, prefixes: Iterable[str], depth: int) -> bool:
    """Whether a name is below one of the prefixes (all are without one) and at most `depth` levels deep (0: any)."""
    prefixes = tuple(prefixes)
    if not prefixes:
        return depth == 0 or name.count(SEPARATOR) < depth
    for prefix in prefixes:
        below = name.removeprefix(prefix + SEPARATOR)
        if name == prefix or (below != name and (depth == 0 or below.count(SEPARATOR) < depth)):
            return True
    return False
