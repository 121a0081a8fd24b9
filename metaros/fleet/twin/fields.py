"""The kinds of values in a twin's document: each checks a value, and says as JSON Schema what it takes."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol

from metaros.fleet.twin.canonical_json import join, kind
from metaros.fleet.twin.errors import TwinError

__all__ = ["Flag", "Key", "Kind", "Number", "Parameters", "Text", "Texts", "Whole", "Word", "check_keys", "unknown"]

MAX_PARAMETERS: Final = 4096
PARAMETER_TEXT_CHARS: Final = 65_536
PARAMETER_ITEMS: Final = 4096
PARAMETER_NAME: Final = r"[A-Za-z_][A-Za-z0-9_.]{0,255}"
_PARAMETER_NAME: Final = re.compile(PARAMETER_NAME)


class Kind(Protocol):
    """What a key's value may be."""

    def check(self, value: Any, path: str) -> Any:
        """The value as programs use it; TwinError names the path and the limit."""

    def schema(self) -> dict[str, Any]:
        """The same as JSON Schema."""


@dataclass(frozen=True, slots=True)
class Key:
    """One row of a table of keys."""

    kind: Kind
    default: Any
    meaning: str


@dataclass(frozen=True, slots=True)
class Text:
    """Text of `least` to `most` characters without control characters, which fits `pattern`."""

    most: int
    pattern: str = ""
    shape: str = ""  # the pattern in words
    least: int = 1

    def check(self, value: Any, path: str) -> str:
        """See Kind."""
        if not isinstance(value, str):
            raise TwinError(path, f"text, not {kind(value)}")
        if not self.least <= len(value) <= self.most:
            raise TwinError(path, f"{self.least} to {self.most} characters, not {len(value)}")
        if any(ord(letter) < 32 or ord(letter) == 127 for letter in value):
            raise TwinError(path, "text without control characters")
        if self.pattern and re.fullmatch(self.pattern, value) is None:
            raise TwinError(path, f"{self.shape}, not {value[:80]!r}")
        return value

    def schema(self) -> dict[str, Any]:
        """See Kind."""
        pattern = {"pattern": f"^(?:{self.pattern})$"} if self.pattern else {}
        return {"type": "string", "minLength": self.least, "maxLength": self.most, **pattern}


@dataclass(frozen=True, slots=True)
class Number:
    """A number from `low` to `high`; whole ones are taken as such."""

    low: float
    high: float

    def check(self, value: Any, path: str) -> float:
        """See Kind."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise TwinError(path, f"a number, not {kind(value)}")
        if not (math.isfinite(value) and self.low <= value <= self.high):
            raise TwinError(path, f"{self.low:g} to {self.high:g}, not {value}")
        return float(value)

    def schema(self) -> dict[str, Any]:
        """See Kind."""
        return {"type": "number", "minimum": self.low, "maximum": self.high}


@dataclass(frozen=True, slots=True)
class Whole:
    """A whole number from `low` to `high`; `zero` is taken as well where it is below."""

    low: int
    high: int
    zero: bool = False

    def check(self, value: Any, path: str) -> int:
        """See Kind."""
        if isinstance(value, bool) or not isinstance(value, int):
            raise TwinError(path, f"a whole number, not {kind(value) if not isinstance(value, float) else value}")
        if not (self.low <= value <= self.high or (self.zero and value == 0)):
            zero = "0, or " if self.zero else ""
            raise TwinError(path, f"{zero}{self.low} to {self.high}, not {value}")
        return value

    def schema(self) -> dict[str, Any]:
        """See Kind."""
        bounds = {"type": "integer", "minimum": self.low, "maximum": self.high}
        return {"anyOf": [{"const": 0}, bounds]} if self.zero else bounds


@dataclass(frozen=True, slots=True)
class Flag:
    """True or false."""

    def check(self, value: Any, path: str) -> bool:
        """See Kind."""
        if not isinstance(value, bool):
            raise TwinError(path, f"true or false, not {kind(value)}")
        return value

    def schema(self) -> dict[str, Any]:
        """See Kind."""
        return {"type": "boolean"}


@dataclass(frozen=True, slots=True)
class Word:
    """One of a few words."""

    words: tuple[str, ...]

    def check(self, value: Any, path: str) -> str:
        """See Kind."""
        if not isinstance(value, str):
            raise TwinError(path, f"one of {', '.join(self.words)}, not {kind(value)}")
        if value not in self.words:
            near = difflib.get_close_matches(value[:80], self.words, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise TwinError(path, f"one of {', '.join(self.words)}, not {value[:80]!r}{hint}")
        return value

    def schema(self) -> dict[str, Any]:
        """See Kind."""
        return {"enum": list(self.words)}


@dataclass(frozen=True, slots=True)
class Texts:
    """A list of texts."""

    most: int
    item: Text
    least: int = 0

    def check(self, value: Any, path: str) -> tuple[str, ...]:
        """See Kind."""
        if not isinstance(value, list | tuple):
            raise TwinError(path, f"a list of texts, not {kind(value)}")
        if not self.least <= len(value) <= self.most:
            raise TwinError(path, f"{self.least} to {self.most} items, not {len(value)}")
        return tuple(self.item.check(text, f"{path}[{index}]") for index, text in enumerate(value))

    def schema(self) -> dict[str, Any]:
        """See Kind."""
        return {"type": "array", "items": self.item.schema(), "minItems": self.least, "maxItems": self.most}


@dataclass(frozen=True, slots=True)
class Parameters:
    """ROS parameters by name: true or false, a number, text, or a list of one of these kinds."""

    def check(self, value: Any, path: str) -> dict[str, Any]:
        """See Kind."""
        if not isinstance(value, dict):
            raise TwinError(path, f"an object of parameters, not {kind(value)}")
        if len(value) > MAX_PARAMETERS:
            raise TwinError(path, f"at most {MAX_PARAMETERS} parameters, not {len(value)}")
        for name, item in value.items():
            below = join(path, name)
            if _PARAMETER_NAME.fullmatch(name) is None:
                raise TwinError(below, "a parameter's name is letters, digits, _ and ., at most 256 characters")
            _check_parameter(item, below)
        return dict(value)

    def schema(self) -> dict[str, Any]:
        """See Kind."""
        scalars: list[dict[str, Any]] = [
            {"type": "boolean"},
            {"type": "number"},
            {"type": "string", "maxLength": PARAMETER_TEXT_CHARS},
        ]
        lists = [{"type": "array", "maxItems": PARAMETER_ITEMS, "items": item} for item in scalars]
        return {
            "type": "object",
            "maxProperties": MAX_PARAMETERS,
            "propertyNames": {"pattern": f"^{PARAMETER_NAME}$"},
            "additionalProperties": {"anyOf": scalars + lists},
        }


def _check_parameter(value: Any, path: str) -> None:
    if not isinstance(value, list):
        _check_scalar(value, path)
        return
    if len(value) > PARAMETER_ITEMS:
        raise TwinError(path, f"at most {PARAMETER_ITEMS} items, not {len(value)}")
    for index, item in enumerate(value):
        _check_scalar(item, f"{path}[{index}]")
    if len({_family(item) for item in value}) > 1:
        raise TwinError(path, "a list of one kind: all true or false, all numbers, or all text")


def _check_scalar(value: Any, path: str) -> None:
    if not isinstance(value, bool | int | float | str):
        raise TwinError(path, f"true or false, a number, text or a list of these, not {kind(value)}")
    if isinstance(value, str) and len(value) > PARAMETER_TEXT_CHARS:
        raise TwinError(path, f"at most {PARAMETER_TEXT_CHARS} characters, not {len(value)}")


def _family(value: Any) -> str:
    return "flag" if isinstance(value, bool) else "text" if isinstance(value, str) else "number"


def unknown(key: str, path: str, known: Collection[str]) -> TwinError:
    """The error of a key that no table has, with the nearest that one has."""
    near = difflib.get_close_matches(key[:80], known, n=1, cutoff=0.6)
    hint = f"did you mean {near[0]!r}?" if near else f"there are: {', '.join(known)}"
    return TwinError(join(path, key), f"unknown key; {hint}")


def check_keys(value: Any, path: str, keys: Mapping[str, Key], *, partial: bool) -> dict[str, Any]:
    """An object by its table: only the keys that are there, each checked. `partial`: null is taken, and left out."""
    if not isinstance(value, dict):
        raise TwinError(path, f"an object, not {kind(value)}")
    found: dict[str, Any] = {}
    for key, item in value.items():
        if key not in keys:
            raise unknown(key, path, tuple(keys))
        if not (partial and item is None):
            found[key] = keys[key].kind.check(item, join(path, key))
    return found
