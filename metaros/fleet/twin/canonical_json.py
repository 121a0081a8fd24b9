"""The one byte form of a document: two documents mean the same exactly when these bytes are the same.

Keys are sorted by code point, there are no spaces, text is UTF-8. 1 and 1.0 are two values, as in ROS parameters.
Reading is strict: no key twice, no NaN or infinity, integers of 64 bits, text that is Unicode, bounded size and depth.
"""

from __future__ import annotations

import hashlib
import json
import math
from typing import Any, Final

from metaros.fleet.twin.errors import TwinError

__all__ = ["MAX_BYTES", "MAX_DEPTH", "canonical", "check_values", "digest", "join", "kind", "read"]

MAX_BYTES: Final = 256 * 1024
MAX_DEPTH: Final = 16
MAX_VALUES: Final = 65_536  # keys, list items and values of one document together
_LOW, _HIGH = -(1 << 63), (1 << 63) - 1


def read(source: str | bytes) -> dict[str, Any]:
    """JSON text as a document; TwinError for anything that other readers could read differently."""
    data = source.encode("utf-8", "surrogatepass") if isinstance(source, str) else source
    if len(data) > MAX_BYTES:
        raise TwinError("", f"the document has {len(data)} bytes, at most {MAX_BYTES} are taken")
    try:
        found = json.loads(data.decode(), object_pairs_hook=_object, parse_constant=_constant)
    except UnicodeDecodeError as error:
        raise TwinError("", f"the document is not UTF-8 at byte {error.start}") from None
    except RecursionError:
        raise TwinError("", f"the document is more than {MAX_DEPTH} levels deep") from None
    except json.JSONDecodeError as error:
        raise TwinError("", f"no JSON at line {error.lineno}, column {error.colno}: {error.msg}") from None
    except TwinError:
        raise
    except ValueError:  # an integer of more digits than Python reads
        raise TwinError("", f"an integer is outside {_LOW} to {_HIGH}") from None
    if not isinstance(found, dict):
        raise TwinError("", f"the document is a JSON object, not {kind(found)}")
    check_values(found)
    return found


def canonical(document: Any) -> bytes:
    """The document's bytes; TwinError for what JSON has no value for, or over the bounds."""
    check_values(document)
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    data = text.encode()
    if len(data) > MAX_BYTES:
        raise TwinError("", f"the document has {len(data)} bytes, at most {MAX_BYTES} are taken")
    return data


def digest(document: Any) -> bytes:
    """SHA-256 of the canonical bytes, which may be given instead of the document."""
    return hashlib.sha256(document if isinstance(document, bytes) else canonical(document)).digest()


def check_values(document: Any) -> None:
    """Whether this is JSON within its bounds, by a walk that no depth can harm; TwinError says where it is not."""
    waiting: list[tuple[Any, str, int]] = [(document, "", 1)]
    count = 0
    while waiting:
        value, path, depth = waiting.pop()
        count += 1
        if count > MAX_VALUES:
            raise TwinError("", f"the document has more than {MAX_VALUES} values")
        if isinstance(value, dict | list) and depth > MAX_DEPTH:
            raise TwinError(path[:200], f"more than {MAX_DEPTH} levels deep")
        if isinstance(value, dict):
            for key, item in value.items():
                _check_key(key, path)
                waiting.append((item, join(path, key), depth + 1))
        elif isinstance(value, list):
            waiting.extend((item, f"{path}[{index}]", depth + 1) for index, item in enumerate(value))
        else:
            _check_leaf(value, path)


def join(path: str, key: str) -> str:
    """The path of a key below another; keys that hold dots or slashes are shown in brackets."""
    shown = key if key and all(letter.isalnum() or letter in "_-" for letter in key) else f"[{key[:80]!r}]"
    return shown if not path else f"{path}{shown}" if shown[0] == "[" else f"{path}.{shown}"


def kind(value: Any) -> str:
    """What a value is, in JSON's words."""
    names: dict[type, str] = {dict: "an object", list: "a list", str: "text", bool: "true or false", type(None): "null"}
    return names.get(type(value), "a number" if isinstance(value, int | float) else type(value).__name__)


def _check_key(key: Any, path: str) -> None:
    if not isinstance(key, str):
        raise TwinError(path, f"a key is text, not {kind(key)}")
    _check_text(key, path)


def _check_leaf(value: Any, path: str) -> None:
    if isinstance(value, str):
        _check_text(value, path)
    elif isinstance(value, bool) or value is None:
        return
    elif isinstance(value, int):
        if not _LOW <= value <= _HIGH:
            raise TwinError(path, f"an integer from {_LOW} to {_HIGH}, not a larger one")
    elif not isinstance(value, float):
        raise TwinError(path, f"{type(value).__name__} is no JSON value")
    elif not math.isfinite(value):
        raise TwinError(path, "a finite number, not NaN or infinity")


def _check_text(text: str, path: str) -> None:
    try:
        text.encode()
    except UnicodeEncodeError:
        raise TwinError(path, "text with half of a surrogate pair is no Unicode") from None


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        seen: set[str] = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise TwinError(join("", twice), "this key is there twice in one object")
    return found


def _constant(name: str) -> Any:
    raise TwinError("", f"{name} is no JSON value: numbers are finite")
