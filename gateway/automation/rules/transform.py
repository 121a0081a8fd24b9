"""What a target is given of an event: all of it, a part, a constant, or a template with values put in.

A template is JSON. A string in it that is nothing but `<name>` becomes that value as it is, a number a number; within
a longer string it becomes text. As values are put into JSON and not into its text, none of them can break out of their
place. `\\<` is a plain `<`. `<rule>` is the rule's name, `<event>` the whole event. A template may put in the same
value often: what comes of it is bounded while it is made, as it grows by events that come from outside.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import orjson

from gateway.automation.rules.errors import RuleInvalidError

__all__ = ["WHOLE", "Path", "RenderedTooLargeError", "Transform", "parse_transform"]

MAX_PATHS = 100
MAX_DEPTH = 16
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,63}")
_PLACE = re.compile(r"\\<|<([A-Za-z_][A-Za-z0-9_-]{0,63})>")
_STEP = re.compile(r"\.([A-Za-z_][A-Za-z0-9_-]*)|\[(\d{1,9})\]|\[\"([^\"\\]{1,256})\"\]")
OWN = ("rule", "event")
KEYS = ("input", "input_path", "transformer")


class RenderedTooLargeError(ValueError):
    """A template with these values is over its bound."""


@dataclass(frozen=True, slots=True)
class Path:
    """`$`, then `.name`, `["name"]` and `[index]`."""

    text: str
    steps: tuple[str | int, ...]

    @classmethod
    def parse(cls, text: Any, at: str) -> Path:
        """RuleInvalidError for what is no path."""
        if not isinstance(text, str) or not text.startswith("$") or len(text) > 512:
            raise RuleInvalidError(at, "a path begins with $, like $.detail.message.percentage")
        steps: list[str | int] = []
        place = 1
        while place < len(text):
            found = _STEP.match(text, place)
            if found is None:
                raise RuleInvalidError(at, f'after {text[:place]!r} comes .name, ["name"] or [0]')
            steps.append(int(found[2]) if found[2] is not None else found[1] or found[3])
            place = found.end()
        return cls(text, tuple(steps))

    def find(self, event: Any) -> Any:
        """What is there; None where nothing is."""
        for step in self.steps:
            if isinstance(step, str) and isinstance(event, Mapping):
                event = event.get(step)
            elif isinstance(step, int) and isinstance(event, Sequence) and not isinstance(event, str | bytes):
                event = event[step] if step < len(event) else None
            else:
                return None
        return event


@dataclass(frozen=True, slots=True)
class Transform:
    """`constant` alone, `path` alone, `template` with its `paths`, or none of them: the whole event."""

    constant: Any = None
    path: Path | None = None
    paths: Mapping[str, Path] = field(default_factory=dict)
    template: Any = None

    def render(self, event: Mapping[str, Any], rule: str, *, most_bytes: int) -> Any:
        """What the target gets, as JSON values. RenderedTooLargeError for a template's values of more than that."""
        if self.template is not None:
            values = {name: path.find(event) for name, path in self.paths.items()}
            return _filled(self.template, _Values({**values, "rule": rule, "event": event}, most_bytes))
        if self.path is not None:
            return self.path.find(event)
        return event if self.constant is None else self.constant


WHOLE = Transform()


def parse_transform(target: Mapping[str, Any], at: str) -> Transform:
    """A target's own; RuleInvalidError names what cannot be."""
    said = [key for key in KEYS if target.get(key) is not None]
    if len(said) > 1:
        raise RuleInvalidError(f"{at}.{said[1]}", f"a target has one of {', '.join(KEYS)}")
    if not said:
        return WHOLE
    at = f"{at}.{said[0]}"
    value = target[said[0]]
    if said[0] == "input":
        return Transform(constant=value)
    if said[0] == "input_path":
        return Transform(path=Path.parse(value, at))
    if not isinstance(value, Mapping) or not set(value) <= {"paths", "template"} or value.get("template") is None:
        raise RuleInvalidError(at, "it has a template, and paths")
    said_paths = value.get("paths") or {}
    if not isinstance(said_paths, Mapping) or len(said_paths) > MAX_PATHS:
        raise RuleInvalidError(f"{at}.paths", f"an object of at most {MAX_PATHS} names and paths")
    for name in said_paths:
        if not isinstance(name, str) or _NAME.fullmatch(name) is None or name in OWN:
            raise RuleInvalidError(
                f"{at}.paths", f"{str(name)[:64]!r} is no name: letters, digits, _ and -, and not {' or '.join(OWN)}"
            )
    paths = {name: Path.parse(path, f"{at}.paths.{name}") for name, path in said_paths.items()}
    _check(value["template"], {*paths, *OWN}, f"{at}.template", MAX_DEPTH)
    return Transform(paths=paths, template=value["template"])


def _check(part: Any, names: set[str], at: str, depth: int) -> None:
    if not depth:
        raise RuleInvalidError(at, f"it is deeper than {MAX_DEPTH}")
    if isinstance(part, str):
        for found in _PLACE.finditer(part):
            if found[1] is not None and found[1] not in names:
                raise RuleInvalidError(at, f"<{found[1]}> is none of {', '.join(sorted(names))}; \\< is a plain <")
    elif isinstance(part, Mapping):
        for key, item in part.items():
            _check(item, names, f"{at}.{key}", depth - 1)
    elif isinstance(part, list):
        for place, item in enumerate(part):
            _check(item, names, f"{at}[{place}]", depth - 1)


class _Values:
    """What is put in, by its name; each time it is, it counts."""

    def __init__(self, values: Mapping[str, Any], most_bytes: int) -> None:
        self._values = values
        self._left = most_bytes
        self._texts: dict[str, str] = {}

    def whole(self, name: str) -> Any:
        """As it is."""
        self.text(name)
        return self._values[name]

    def text(self, name: str) -> str:
        """As text; RenderedTooLargeError where no more may be put in."""
        text = self._texts.get(name)
        if text is None:
            text = self._texts[name] = _text(self._values[name])
        self._left -= len(text)
        if self._left < 0:
            raise RenderedTooLargeError("the template puts in more than may be given")
        return text


def _filled(part: Any, values: _Values) -> Any:
    if isinstance(part, str):
        whole = _PLACE.fullmatch(part)
        if whole is not None and whole[1] is not None:
            return values.whole(whole[1])
        return _PLACE.sub(lambda found: "<" if found[1] is None else values.text(found[1]), part)
    if isinstance(part, Mapping):
        return {key: _filled(item, values) for key, item in part.items()}
    if isinstance(part, list):
        return [_filled(item, values) for item in part]
    return part


def _text(value: Any) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else orjson.dumps(value).decode()
