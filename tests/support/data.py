"""Where the big data sets are: `$METAROS_DATA`, else `../shared/data` beside the clone."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


def data_set(name: str) -> Path:
    """The path of a data set, or a visible skip where it is not there; in CI it must be there."""
    root = Path(os.environ.get("METAROS_DATA") or REPOSITORY.parent / "shared" / "data")
    path = root / name
    if not path.exists():
        message = f"data set {name} not found under {root} (set METAROS_DATA)"
        if os.environ.get("CI"):
            pytest.fail(message)
        pytest.skip(message)
    return path
