"""Fixtures shared by the whole suite."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Generator, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from metaros.clock import ManualClock
from tests.support.ports import free_port as _free_port

if TYPE_CHECKING:
    from tests.support.servers.postgres import PostgresServer
    from tests.support.servers.seaweed import SeaweedServer


ROOT = Path(__file__).resolve().parent.parent
# What makes a test one of the real world, wherever it stands; a test that needs time, kills or root marks itself.
INTEGRATION_FOLDERS = ("tests/e2e/", "tests/faults/", "tests/system/", "tests/examples/")
INTEGRATION_FIXTURES = frozenset({"browser", "postgres", "postgres_server", "seaweed"})
LONGEST_ID = 100  # letters


def pytest_configure() -> None:
    """Programs under test obey Ctrl-C, also where a shell started the tests in the background, which ignores it.

    They keep the bytecode they compile, also where the environment forbids it: thousands of processes start here.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
    if find_spec("sniffio") is None:  # httpcore looks for it several times in each request, the whole path through
        sys.modules["sniffio"] = None  # type: ignore[assignment]
    # A test may fork where gRPC runs; its handlers would start gRPC's threads again in the child, whose files are being
    # closed for the program that it becomes: the thread then aborts it.
    os.environ["GRPC_ENABLE_FORK_SUPPORT"] = "0"
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of small matrices its threads only wait for each other: busily


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """What `make test` leaves out by the folder it does not even import."""
    left_out = config.getoption("markexpr") == "not integration" and collection_path.is_dir()
    return (left_out and f"{collection_path.relative_to(ROOT).as_posix()}/" in INTEGRATION_FOLDERS) or None


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Nothing of what is imported and collected is garbage: it is looked through neither now nor during the tests."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(2_000, 10, 50)  # a worker's tests leave little that only a look through all of it would find
        gc.enable()


@pytest.hookimpl(wrapper=True)  # before `-m` chooses, and before xdist looks for groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> Iterator[None]:
    """Mark what is of the real world by the table above; tests that share a module's fixture stay in one worker."""
    for item in items:
        asked = set(getattr(item, "fixturenames", ()))
        if hasattr(item, "callspec"):  # a fixture with a parameter that says which other one it takes
            asked |= {value for value in item.callspec.params.values() if isinstance(value, str)}
        if item.nodeid.startswith(INTEGRATION_FOLDERS) or not INTEGRATION_FIXTURES.isdisjoint(asked):
            item.add_marker("integration")
        if item.get_closest_marker("xdist_group") is None and _shares_a_fixture(item):
            item.add_marker(pytest.mark.xdist_group(item.nodeid.partition("::")[0]))
    items.sort(key=lambda item: not item.nodeid.startswith(INTEGRATION_FOLDERS))  # the longest must not be the last
    return (yield)


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Megabytes are no name: it goes to every worker, and into the environment of every process that a test starts."""
    return f"{argname}-{len(val)}" if isinstance(val, str | bytes) and len(val) > LONGEST_ID else None


def _shares_a_fixture(item: pytest.Item) -> bool:
    """Whether it takes a fixture that its module's other tests take, too."""
    info = getattr(item, "_fixtureinfo", None)
    found = info.name2fixturedefs if info is not None else {}
    return any(fixtures[-1].scope in ("module", "class") for fixtures in found.values())


@pytest.fixture
def clock() -> ManualClock:
    """A clock that moves only when told."""
    return ManualClock()


@pytest.fixture
def free_port() -> int:
    """A TCP port on loopback that is free."""
    return _free_port()


@pytest.fixture
def zenoh_router() -> Iterator[str]:
    """A real Zenoh router on a free loopback port, its own island; yields the endpoint to connect to."""
    from tests.support.servers.routers import zenoh_router

    with zenoh_router() as endpoint:
        yield endpoint


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[PostgresServer]:
    """This worker's PostgreSQL server, for what several tests share; only CI may not be without."""
    from tests.support.servers.postgres import PostgresServer, postgres_binaries

    if postgres_binaries() is None and not os.environ.get("CI"):
        pytest.skip("PostgreSQL is not installed (Debian: apt install postgresql)")
    server = PostgresServer()
    try:
        server.start()
        yield server
    finally:
        server.close()


@pytest.fixture
def postgres(postgres_server: PostgresServer) -> Iterator[PostgresServer]:
    """The same for one test: it takes its schemas back."""
    with postgres_server.lending():
        yield postgres_server


@pytest.fixture(scope="session")
def seaweed() -> Iterator[SeaweedServer]:
    """This worker's S3 server."""
    from tests.support.servers.seaweed import SeaweedServer

    server = SeaweedServer()
    try:
        server.start()
        yield server
    finally:
        server.close()
