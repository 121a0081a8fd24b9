"""Commands beside real nodes on a real router, which the tests of a file share: they keep apart by names."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from socketserver import BaseRequestHandler, ThreadingTCPServer

import pytest

import metaros
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.wire import WireSession, open_router
from metaros.wire.names import mangle
from tests.support.ports import free_port
from tests.support.processes.command_line import Done, call_metaros
from tests.support.waiting import wait_until

Run = Callable[..., Done]
Reported = Callable[..., None]

LOOKING = {"topic", "node", "service", "param", "action", "lifecycle", "graph", "top"}
PATIENCE = ("--spin-time", "60")  # for the router's answer on a busy machine


@pytest.fixture(autouse=True)
def own_runtime_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No `metaros up` of this machine is seen, whatever runs."""
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path / "run"))


@pytest.fixture(scope="module")
def zenoh_router() -> Iterator[str]:
    """The endpoint of a router that the tests of a file share."""
    with open_router(free_port()) as router:
        yield router.endpoint


@pytest.fixture(scope="module")
def zenoh_port(zenoh_router: str) -> str:
    """Its port."""
    return zenoh_router.rpartition(":")[2]


@pytest.fixture
def foreign_port() -> Iterator[int]:
    """A port of a program that is no router: it hangs up on who does not speak its language."""
    with ThreadingTCPServer(("127.0.0.1", 0), BaseRequestHandler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield server.server_address[1]
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def told(zenoh_router: str) -> Iterator[Reported]:
    """`told("/chatter")` waits until the router knows an end of that name: to declare one does not wait for it."""
    with closing(WireSession(connect=zenoh_router)) as session, session.client() as client:

        def wait(name: str, ends: int = 1) -> None:
            def known() -> bool:
                answers = client.liveliness().get("@ros2_lv/0/**")
                keys = [str(answer.ok.key_expr).split("/") for answer in answers if answer.ok is not None]
                return sum(mangle(name) in key for key in keys) >= ends

            wait_until(known)

        yield wait


@pytest.fixture(scope="module")
def run(zenoh_port: str) -> Run:
    """`run("topic", "list")` on the shared router, in this process."""

    def call(*arguments: str) -> Done:
        patience = PATIENCE if arguments[0] in LOOKING and not {"--spin-time", "pub"} & {*arguments} else ()
        done = call_metaros(*arguments, *patience, "--zenoh-port", zenoh_port)
        sys.stderr.write(done.err)  # a test that fails shows it
        return done

    return call


@pytest.fixture(scope="module")
def talker(zenoh_router: str, told: Reported) -> Iterator[metaros.Node]:
    """A node that publishes /chatter at 20 Hz and serves ~/reset."""
    with (
        metaros.Context(connect=zenoh_router) as context,
        metaros.Node("talker", namespace="/demo", context=context) as node,
    ):
        publisher = node.create_publisher(String, "/chatter", 10)
        count = iter(range(1_000_000))

        @node.timer(0.05)
        def tick() -> None:
            publisher.publish(String(data=f"hello {next(count)}"))

        @node.service(Trigger, "~/reset")
        def reset(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = True, "done"
            return response

        with spinning(node):
            told("/demo/talker/reset")
            yield node


@contextmanager
def spinning(*nodes: metaros.Node) -> Iterator[None]:
    """Nodes spin in a thread."""
    executor = metaros.SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()


def assert_reported(run: Run, table: Mapping[tuple[str, ...], tuple[int, str]], *noun: str) -> None:
    """Commands that cannot be: each ends with the code of the table and says the word, in one piece."""
    done = {words: run(*noun, *words) for words in table}
    wrong = {words: one for words, one in done.items() if one.code != table[words][0] or table[words][1] not in one.err}
    assert wrong == {}
    assert [one for one in done.values() if "Traceback" in one.err] == []
