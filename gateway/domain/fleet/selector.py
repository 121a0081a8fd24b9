"""Label selectors for robots: terms that must all hold, as `site=lab, kind in (arm, cart), !=`.

    label=value          the label has that value
    label!=value         it has another one, or none at all
    label in (a, b)      it has one of these
    label                it is there, whatever its value
    robot=sim_1          `robot` is the robot's own id, whatever its labels say

An empty selector names every robot.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from gateway.domain.errors import SelectorError

__all__ = ["MAX_LABELS", "Selector", "Term", "check_labels"]

MAX_LABELS = 64
MAX_TERMS = 32
MAX_VALUES = 256
MAX_CHARS = 4096
LABEL = r"[A-Za-z0-9_](?:[A-Za-z0-9_./-]{0,62}[A-Za-z0-9_])?"
VALUE = r"[A-Za-z0-9_](?:[A-Za-z0-9_.:/@+-]{0,126}[A-Za-z0-9_])?"
_LABEL, _VALUE = re.compile(LABEL), re.compile(VALUE)
_TERM = re.compile(
    rf"\s*(?P<label>{LABEL})\s*(?:(?P<sign>!=|==|=)\s*(?P<value>{VALUE})|in\s*\((?P<values>[^()]*)\))?\s*(?:,|\Z)"
)
_SHAPE = "terms look like label=value, label!=value, label in (a, b) or label, with commas between them"


@dataclass(frozen=True, slots=True)
class Term:
    """One condition; `values` is empty for `has`."""

    label: str
    sign: Literal["in", "not", "has"]
    values: frozenset[str] = frozenset()

    def holds(self, labels: Mapping[str, str]) -> bool:
        """Whether the labels fit."""
        value = labels.get(self.label)
        if self.sign == "not":
            return value not in self.values
        return value is not None and (self.sign == "has" or value in self.values)


@dataclass(frozen=True, slots=True)
class Selector:
    """All terms hold; none: every robot is named."""

    text: str
    terms: tuple[Term, ...] = ()

    @classmethod
    def parse(cls, text: str) -> Selector:
        """SelectorError says where the text stops being one."""
        if len(text) > MAX_CHARS:
            raise SelectorError(f"a selector has at most {MAX_CHARS} characters, not {len(text)}")
        if not text.strip():
            return cls("")
        terms: list[Term] = []
        place = 0
        while place < len(text):
            found = _TERM.match(text, place)
            if found is None:
                raise SelectorError(f"selector: {text[place : place + 60].strip()!r} is no term; {_SHAPE}")
            terms.append(_term(found))
            place = found.end()
        if text.rstrip().endswith(","):
            raise SelectorError("selector: there is no term after the last comma")
        if len(terms) > MAX_TERMS:
            raise SelectorError(f"a selector has at most {MAX_TERMS} terms, not {len(terms)}")
        return cls(text.strip(), tuple(terms))

    def matches(self, robot: str, labels: Mapping[str, str]) -> bool:
        """Whether a robot with these labels is named."""
        known = {**labels, "robot": robot}
        return all(term.holds(known) for term in self.terms)


def check_labels(labels: Mapping[str, str | None]) -> None:
    """SelectorError for labels that no selector could name; a value of None takes a label away."""
    if len(labels) > MAX_LABELS:
        raise SelectorError(f"a robot has at most {MAX_LABELS} labels, not {len(labels)}")
    for label, value in labels.items():
        if _LABEL.fullmatch(label) is None or label == "robot":
            raise SelectorError(f"label {label[:80]!r}: 1 to 64 letters, digits and _ . / -, and not `robot`")
        if value is not None and _VALUE.fullmatch(value) is None:
            raise SelectorError(f"label {label}: its value is 1 to 128 letters, digits and _ . : / @ + -")


def _term(found: re.Match[str]) -> Term:
    label, sign = found["label"], found["sign"]
    if found["values"] is not None:
        values = [item.strip() for item in found["values"].split(",")]
        if len(values) > MAX_VALUES or not all(_VALUE.fullmatch(item) for item in values):
            raise SelectorError(f"selector: {label} in (…) takes 1 to {MAX_VALUES} values, with commas between them")
        return Term(label, "in", frozenset(values))
    if sign is None:
        return Term(label, "has")
    return Term(label, "not" if sign == "!=" else "in", frozenset((found["value"],)))
