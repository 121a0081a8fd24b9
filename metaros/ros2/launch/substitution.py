"""Substitutions: texts that are known when a launch file runs, not yet when it is read."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeAlias

__all__ = [
    "SomeSubstitutionsType",
    "Substitution",
    "SubstitutionFailure",
    "TextSubstitution",
    "normalize_to_list_of_substitutions",
    "perform_substitutions",
]


class SubstitutionFailure(RuntimeError):
    """A substitution has no text here."""


class Substitution:
    """Something with a text. Subclasses have `perform`."""

    def perform(self, context: Any) -> str:
        """The text, in this launch."""
        raise NotImplementedError

    def describe(self) -> str:
        """What it is, for `--show-args` and errors."""
        return f"{type(self).__name__}()"


class TextSubstitution(Substitution):
    """A text that is known already."""

    def __init__(self, *, text: str) -> None:
        if not isinstance(text, str):
            raise TypeError(f"TextSubstitution takes a str, not {type(text).__name__}")
        self.text = text

    def perform(self, context: Any) -> str:
        """The text."""
        return self.text

    def describe(self) -> str:
        """The text in quotes."""
        return repr(self.text)


SomeSubstitutionsType: TypeAlias = "str | Path | Substitution | Iterable[str | Path | Substitution]"


def normalize_to_list_of_substitutions(value: SomeSubstitutionsType) -> list[Substitution]:
    """A text, a substitution, or several of them, as a list of substitutions."""
    if isinstance(value, Substitution):
        return [value]
    if isinstance(value, (str, Path)):
        return [TextSubstitution(text=str(value))]
    if isinstance(value, Iterable):
        return [part for item in value for part in normalize_to_list_of_substitutions(item)]
    raise TypeError(f"{value!r} is no text and no substitution")


def perform_substitutions(context: Any, value: SomeSubstitutionsType) -> str:
    """Their texts, joined."""
    return "".join(part.perform(context) for part in normalize_to_list_of_substitutions(value))
