"""What the pages share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.processes.fork_server import warm_metaros


@pytest.fixture(scope="session")
def warm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """`metaros` for pages that start gateways: this worker's."""
    with warm_metaros(tmp_path_factory.mktemp("warm")) as path:
        yield path
