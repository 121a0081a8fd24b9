"""Worker threads: bounded, in order, gone when idle."""

from __future__ import annotations

import threading

from metaros.node.action.workers import Workers
from tests.support.waiting import wait_until


def test_jobs_run_beside_each_other_up_to_the_bound_and_in_order():
    workers = Workers(2, name="test-worker", idle_s=0.05)
    gates = [threading.Event() for _ in range(4)]
    began: list[int] = []

    def job(number: int) -> None:
        began.append(number)
        gates[number].wait(60)

    jobs = [lambda n=number: job(n) for number in range(4)]
    for each in jobs:
        workers.submit(each)
    wait_until(lambda: len(began) == 2)
    assert set(began) == {0, 1}
    assert workers.withdraw(jobs[2])
    assert not workers.withdraw(jobs[2])
    assert not workers.withdraw(jobs[0])
    gates[0].set()
    wait_until(lambda: 3 in began)
    for gate in gates:
        gate.set()
    wait_until(lambda: workers.running == 0)
    assert 2 not in began
    wait_until(lambda: not any(thread.name.startswith("test-worker") for thread in threading.enumerate()))


def test_what_has_not_begun_can_be_forgotten():
    workers = Workers(1, name="test-worker", idle_s=0.05)
    gate, began = threading.Event(), threading.Event()

    def first() -> None:
        began.set()
        gate.wait(60)

    ran: list[int] = []
    workers.submit(first)
    workers.submit(lambda: ran.append(1))
    assert began.wait(60)
    workers.clear()
    gate.set()
    wait_until(lambda: workers.running == 0)
    assert ran == []
