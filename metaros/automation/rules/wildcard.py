r"""Texts with stars: `*` stands for any letters or none, `\*` for a star, `\\` for a backslash.

A text is looked through once from left to right, each piece between two stars at its first place: no pattern and no
text make it slow, as they could make a regular expression.
"""

from __future__ import annotations

from dataclasses import dataclass

from metaros.automation.rules.errors import PatternError

__all__ = ["Wildcard", "read_wildcard"]


@dataclass(frozen=True, slots=True)
class Wildcard:
    """The pieces between the stars; one piece is a text without a star."""

    pieces: tuple[str, ...]

    def fits(self, text: str) -> bool:
        """Whether the whole text is of this form."""
        if len(self.pieces) == 1:
            return text == self.pieces[0]
        first, *middle, last = self.pieces
        end = len(text) - len(last)
        if end < len(first) or not text.startswith(first) or not text.endswith(last):
            return False
        at = len(first)
        for piece in middle:
            at = text.find(piece, at, end)
            if at < 0:
                return False
            at += len(piece)
        return True


def read_wildcard(text: str, path: str) -> Wildcard:
    """The pieces of a text with stars; PatternError for two stars side by side or a stray backslash."""
    pieces: list[str] = []
    piece, letters = "", iter(text)
    for letter in letters:
        if letter == "*":
            if pieces and not piece:
                raise PatternError(path, f"two stars side by side in {text[:80]!r}: one stands for any letters already")
            pieces.append(piece)
            piece = ""
        elif letter == "\\":
            escaped = next(letters, "")
            if escaped not in ("*", "\\"):
                raise PatternError(path, r"a backslash stands before a star or a backslash only: \* or \\")
            piece += escaped
        else:
            piece += letter
    return Wildcard((*pieces, piece))
