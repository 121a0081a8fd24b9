"""The command `metaros`: one module a noun; other packages add nouns by the entry-point group `metaros.cli`."""

from __future__ import annotations
