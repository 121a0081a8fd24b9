"""The literals of an interface definition: numbers, booleans, quoted text, and lists of them."""

from __future__ import annotations

import re

from metaros.errors import DefinitionError

__all__ = ["format_literal", "parse_list", "parse_scalar", "unquoted_comment_start"]

Scalar = bool | int | float | str

_TRUE = ("true", "True", "1")
_FALSE = ("false", "False", "0")
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "0": "\0", "\\": "\\", '"': '"', "'": "'"}
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_INTEGER = re.compile(r"[+-]?(?:0[xX][0-9a-fA-F]+|0[bB][01]+|0[oO][0-7]+|[0-9]+)\Z")


def unquoted_comment_start(line: str) -> int:
    """Where the comment of `line` begins (the first `#` outside quotes), else its length."""
    quote = ""
    escaped = False
    for position, char in enumerate(line):
        if escaped:
            escaped = False
        elif quote and char == "\\":
            escaped = True
        elif quote:
            quote = "" if char == quote else quote
        elif char == "#":
            return position
        elif char in "\"'" and _opens_literal(line[:position]):
            quote = char
            if not _closes(line[position + 1 :], char):
                quote = ""
    return len(line)


def _opens_literal(before: str) -> bool:
    """A quote opens a literal after `=`, `[`, `,` or a blank; elsewhere it is an apostrophe."""
    stripped = before.rstrip()
    return bool(stripped) and (stripped != before or stripped[-1] in "=[,")


def _closes(rest: str, quote: str) -> bool:
    return quote in rest


def parse_scalar(base: str, text: str) -> Scalar:
    """The value of `text` as a literal of the primitive type `base`."""
    if base in ("string", "wstring"):
        return _text(text)
    if base == "bool":
        if text in _TRUE or text in _FALSE:
            return text in _TRUE
        raise DefinitionError(f"{text[:40]!r} is no bool: true, false, 1 or 0")
    try:
        if base in ("float32", "float64"):
            return float(text)
        if len(text) > 80 or not _INTEGER.match(text):
            raise ValueError
        return int(text, 10) if text.lstrip("+-").isdigit() else int(text, 0)
    except ValueError:
        raise DefinitionError(f"{text[:40]!r} is no {base}") from None


def _text(text: str) -> str:
    quote = text[:1]
    if quote not in ('"', "'") or not quote:
        return text
    if len(text) < 2 or not _ends_with_quote(text, quote):
        raise DefinitionError(f"the text {text[:40]!r} has no closing quote")
    return _unescape(text[1:-1])


def _ends_with_quote(text: str, quote: str) -> bool:
    body = text[1:-1]
    trailing = len(body) - len(body.rstrip("\\"))
    return text[-1] == quote and trailing % 2 == 0


def _unescape(text: str) -> str:
    return _ESCAPE.sub(lambda match: _ESCAPES.get(match[1], match[0]), text)


def parse_list(base: str, text: str) -> list[Scalar]:
    """The values of a list literal like `[1, 2, 3]` or `["a", "b"]`."""
    if not (text.startswith("[") and text.endswith("]")):
        raise DefinitionError(f"the default of an array looks like [1, 2], not {text[:40]!r}")
    return [parse_scalar(base, item) for item in _items(text[1:-1])]


def _items(text: str) -> list[str]:
    items: list[str] = []
    quote, escaped, start = "", False, 0
    for position, char in enumerate(text):
        if escaped:
            escaped = False
        elif quote and char == "\\":
            escaped = True
        elif quote:
            quote = "" if char == quote else quote
        elif char in "\"'" and not text[start:position].strip():
            quote = char
        elif char == ",":
            items.append(text[start:position].strip())
            start = position + 1
    last = text[start:].strip()
    return [*items, last] if items or last else []


def format_literal(base: str, value: object) -> str:
    """The literal that parses back to `value`."""
    if isinstance(value, list):
        return "[" + ", ".join(format_literal(base, item) for item in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        body = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\r", "\\r")
        return '"' + body.replace("\t", "\\t").replace("\0", "\\0") + '"'
    return repr(value)
