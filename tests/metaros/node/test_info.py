"""How many arguments a callback takes."""

from __future__ import annotations

import inspect
import math
from typing import Any

import pytest

from metaros.errors import UsageError
from metaros.node.info import takes


def test_builtins_are_counted_as_python_reads_their_signatures(monkeypatch: pytest.MonkeyPatch) -> None:
    heard: list[Any] = []
    plain: tuple[tuple[Any, int], ...] = ((heard.append, 1), (heard.insert, 2), (math.sqrt, 1), (heard.clear, 0))
    for callback, count in plain:
        assert len(inspect.signature(callback).parameters) == count
    monkeypatch.setattr(inspect, "signature", None)  # it is not asked
    assert [takes(callback, 2, 1, 0) for callback, _ in plain] == [count for _, count in plain]
    monkeypatch.undo()
    assert takes({}.get, 1, 2) == 1  # its second one may be left away
    assert takes(print, 1, 2) == 1
    assert takes({}.update, 1, 2) == 1  # tells no signature
    for callback, counts in ((heard.clear, (1, 2)), (heard.insert, (1,)), (lambda: None, (1, 2))):
        with pytest.raises(UsageError, match=f"must accept {' or '.join(map(str, counts))} positional"):
            takes(callback, *counts)
