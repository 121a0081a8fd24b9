"""What runs inside a peer's process: counting, and round trips that get lost."""

from __future__ import annotations

import ast
import sys
import threading
from pathlib import Path

import pytest

from load_tests.peers import role
from load_tests.peers.role import Pings, Tally, quantile


def test_reading_a_tally_does_not_count() -> None:
    tally = Tally()
    assert tally.read() == 0
    for _ in range(3):
        tally.tick()
    assert (tally.read(), tally.read()) == (3, 3)


def test_quantiles_are_values_that_there_are() -> None:
    values = list(range(100, 0, -1))
    assert quantile(values, 0.5) == 51
    assert quantile(values, 0.99) == 100
    assert quantile([7], 0.99) == 7


def test_a_chain_of_pings_ends_at_its_count() -> None:
    pings = Pings()
    wanted = threading.Semaphore(0)
    pings.send = wanted.release
    stop = threading.Event()

    def peer() -> None:
        while not stop.is_set():
            if wanted.acquire(timeout=0.05):
                pings.answered()

    thread = threading.Thread(target=peer)
    thread.start()
    try:
        pings.run(20, 30.0)
    finally:
        stop.set()
        thread.join()
    assert len(pings.took_ns) == 20
    assert pings.resent == 0


def test_a_lost_ping_is_sent_again_and_a_late_answer_ignored() -> None:
    pings, sent = Pings(), []

    def send() -> None:
        sent.append(None)
        if len(sent) > 1:
            pings.answered()

    pings.send = send
    pings.run(1, 30.0, patience_s=0.01)
    assert (len(sent), len(pings.took_ns), pings.resent) == (2, 1, 1)
    pings.answered()
    assert len(pings.took_ns) == 1


def test_a_peer_that_never_answers_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(role, "_HOPELESS", 1)
    monkeypatch.setattr(role, "_STRAY_S", 0.0)
    with pytest.raises(TimeoutError, match="2 pings in a row"):
        Pings().run(5, 30.0, patience_s=0.01)


def test_it_needs_nothing_but_the_standard_library() -> None:
    tree = ast.parse(Path(role.__file__).read_text())
    modules = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    modules |= {str(node.module).split(".")[0] for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert modules <= set(sys.stdlib_module_names)
