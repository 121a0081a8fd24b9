"""One gateway for the tests of a module, and clients of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.gateways.lambda_gateway import LambdaGateway, lambda_gateway


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LambdaGateway]:
    """A gateway that runs functions."""
    with lambda_gateway(tmp_path_factory.mktemp("lambda")) as running:
        yield running


@pytest.fixture(scope="module")
def aws(served: LambdaGateway) -> Any:
    """boto3's client of it, an admin's."""
    return served.client()
