"""Tests that ask for `engine` run on both databases, those that ask for `source` also on batches and on segments."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.objects import open_objects
from gateway.store.engine import StoreEngine
from tests.gateway.history.source import EngineSource, compact_all
from tests.gateway.store.conftest import connect, engine, store_url

__all__ = ["connect", "engine", "source", "store_url"]


@pytest.fixture(params=["batches", "segments"])
def source(request: pytest.FixtureRequest, engine: StoreEngine, tmp_path: Path) -> Callable[..., EngineSource]:
    """Makes a source of what is committed by then: as it came, or compacted. It may be told another class."""
    objects = open_objects("", tmp_path)

    def made(kind: type[EngineSource] = EngineSource) -> EngineSource:
        if request.param == "segments":
            assert compact_all(engine, objects)
        return kind(engine, objects)

    return made
