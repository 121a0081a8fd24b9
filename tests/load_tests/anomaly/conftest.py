"""The development series, read once: a hundred and sixty thousand rows with a stamp each."""

from __future__ import annotations

import pytest

from load_tests.anomaly.nab_files import Series, read_folder
from tests.support.data import data_set


@pytest.fixture(scope="session")
def development() -> tuple[Series, ...]:
    """All of them, with their windows."""
    read, labelled = read_folder(data_set("nab_dev"))
    assert labelled
    return tuple(read)
