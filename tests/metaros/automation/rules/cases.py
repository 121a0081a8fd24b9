"""Events, and patterns about them of which a good part matches: drawn from a seeded generator."""

from __future__ import annotations

import random  # noqa: TID251 - a type, and seeded
from typing import Any

__all__ = ["event", "pattern"]

Document = dict[str, Any]
NAMES = ("robot", "state", "level", "where", "node")
TEXTS = (
    "",
    "a",
    "ab",
    "AB",
    "abc",
    "arm/left",
    "arm/right",
    "ARM/left",
    "a*b",
    "back\\slash",
    "two\nlines",
    "É",
    "é",
    "1",
)
ADDRESSES = ("10.0.0.1", "10.0.1.7", "192.168.0.9", "2001:db8::1", "::1", "10.0.0.300")
BLOCKS = ("10.0.0.0/24", "10.0.0.0/8", "10.0.0.1/32", "0.0.0.0/0", "2001:db8::/32", "::/0", "::1/128")
NUMBERS = (0, 1, -1, 1.0, 2.5, 5, 10, 100.0, 2**53 + 1, -3e5, 0.0)


def event(rng: random.Random, depth: int = 0) -> Document:
    """An object of an event; the outermost has all levels."""
    names = rng.sample(NAMES, rng.randrange(0 if depth else 1, len(NAMES)))
    return {name: _value(rng, depth) for name in names}


def _value(rng: random.Random, depth: int) -> Any:
    kind = rng.random()
    if kind < 0.25 and depth < 3:
        return event(rng, depth + 1)
    if kind < 0.37:
        return [_scalar(rng) for _ in range(rng.randrange(4))]
    if kind < 0.43 and depth < 3:
        return [
            event(rng, depth + 1) if rng.random() < 0.8 else _value(rng, depth + 1) for _ in range(rng.randrange(4))
        ]
    return _scalar(rng)


def _scalar(rng: random.Random) -> Any:
    kinds = (TEXTS, TEXTS, NUMBERS, NUMBERS, ADDRESSES, (True, False), (None,))
    return rng.choice(rng.choice(kinds))


def pattern(rng: random.Random, about: Document, depth: int = 0) -> Document:
    """A pattern that is likely to match an event."""
    found: Document = {}
    names = list(about) if about and rng.random() < 0.85 else list(NAMES)
    for name in rng.sample(names, min(len(names), rng.choice([1, 1, 2, 3]))):
        found[name] = _part(rng, about.get(name), depth)
    if depth < 3 and rng.random() < 0.15:
        found["$or"] = [pattern(rng, about, depth + 1) for _ in range(rng.choice([2, 2, 3]))]
    return found


def _part(rng: random.Random, value: Any, depth: int) -> Any:
    objects = (
        [value]
        if isinstance(value, dict)
        else [item for item in value or [] if isinstance(item, dict)]
        if (isinstance(value, list))
        else []
    )
    if depth < 3 and (objects or rng.random() < 0.06):
        return pattern(rng, _one_or_all(rng, objects), depth + 1)
    values = value if isinstance(value, list) else [value]
    plain = [item for item in values if not isinstance(item, dict | list)] or [_scalar(rng)]
    return [_entry(rng, rng.choice(plain)) for _ in range(rng.choice([1, 1, 1, 2, 3]))]


def _one_or_all(rng: random.Random, objects: list[Document]) -> Document:
    """One of a list's objects, or what it would be like to have the fields of all."""
    if objects and rng.random() < 0.6:
        return rng.choice(objects)
    return {name: value for each in objects for name, value in each.items()}


def _entry(rng: random.Random, value: Any) -> Any:
    kind = rng.random()
    if kind < 0.3:
        return value if rng.random() < 0.7 else _scalar(rng)
    if kind < 0.4:
        return {"exists": rng.random() < 0.6}
    if kind < 0.55:
        return {"anything-but": _refused(rng, value)}
    if isinstance(value, int | float) and not isinstance(value, bool) and kind < 0.95:
        return {"numeric": _span(rng, float(value) if rng.random() < 0.3 else value)}
    return _about_text(rng, value if isinstance(value, str) else rng.choice(TEXTS))


def _about_text(rng: random.Random, text: str) -> Document:
    text = text if rng.random() < 0.8 else rng.choice(TEXTS)
    cut = rng.randrange(len(text) + 1)
    any_case = {"equals-ignore-case": text[:cut].swapcase()}
    entries: list[Document] = [
        {"prefix": text[:cut]},
        {"suffix": text[cut:]},
        {"prefix": any_case},
        {"suffix": {"equals-ignore-case": text[cut:].upper()}},
        {"equals-ignore-case": text.swapcase()},
        {"wildcard": _wild(rng, text)},
        {"cidr": rng.choice(BLOCKS)},
    ]
    return rng.choice(entries)


def _wild(rng: random.Random, text: str) -> str:
    pieces = []
    for letter in text:
        star = rng.random() < 0.3 and (not pieces or pieces[-1] != "*")
        pieces.append("*" if star else f"\\{letter}" if letter in "*\\" else letter)
    if pieces and pieces[-1] != "*" and rng.random() < 0.3:
        pieces.append("*")
    return "".join(pieces)


def _refused(rng: random.Random, value: Any) -> Any:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value if rng.random() < 0.3 else rng.sample(NUMBERS, rng.choice([1, 2, 3]))
    text = value if isinstance(value, str) and rng.random() < 0.6 else rng.choice(TEXTS)
    others = rng.sample(TEXTS, 2)
    stars = [_wild(rng, item) for item in (text, *others)]
    return rng.choice(
        [
            text,
            [text, *others],
            others,
            {"prefix": text[:2]},
            {"prefix": [text[:1], "arm"]},
            {"suffix": text[-2:]},
            {"suffix": [text[-1:], "left"]},
            {"wildcard": stars[0]},
            {"wildcard": stars},
            {"equals-ignore-case": text.upper()},
            {"equals-ignore-case": [text.swapcase(), "AB"]},
        ]
    )


def _span(rng: random.Random, value: float) -> list[Any]:
    return rng.choice(
        [
            ["=", value],
            ["<", value],
            ["<=", value],
            [">", value],
            [">=", value],
            [">", value - 1, "<=", value],
            [">=", value, "<", value + 2],
            [">", value, "<", value + 2],
            [">", rng.choice(NUMBERS)],
        ]
    )
