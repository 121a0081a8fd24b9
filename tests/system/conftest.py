"""What tests of the real programs share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.processes.stack import Stack


@pytest.fixture(scope="session")
def shared_gateway(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """This worker's `metaros gateway`, for tests that neither stop it nor need settings of its own.

    `Stack.beside` makes a robot's side on it; robots keep apart by their names.
    """
    with Stack(tmp_path_factory.mktemp("gateway")) as stack:
        stack.gateway()
        yield stack
