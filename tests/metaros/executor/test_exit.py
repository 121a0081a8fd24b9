"""A program ends although a callback blocks, on every executor that has threads of its own."""

from __future__ import annotations

from tests.support.processes.forked import ended, forked

IMPORTS = """
import threading
import metaros, metaros.executor, metaros.executor.critical_thread, metaros.executor.fair_executor, metaros.node
from metaros.executor import critical_thread, pool

critical_thread._JOIN_S = pool._JOIN_S = 0.2
"""
PROGRAM = """
context = metaros.Context(domain_id=0, connect=[])
node = metaros.Node("stuck", context=context)
inside = threading.Event()

def block():
    inside.set()
    threading.Event().wait(60)

node.create_timer(0.01, block)
executor = {executor}
executor.add_node(node{options})
thread = threading.Thread(target=executor.spin)
thread.start()
assert inside.wait(60)
executor.shutdown()
{ending}
"""


def test_a_blocked_callback_does_not_hold_up_the_programs_end() -> None:
    codes = [
        PROGRAM.format(executor=executor, options=options, ending=ending)
        for executor, options in (
            ("metaros.MultiThreadedExecutor()", ""),
            ("metaros.FairExecutor()", ", critical=True"),
        )
        for ending in ("context.close()", "")
    ]
    with forked(codes, imports=IMPORTS) as process:
        assert ended(process) == (dict.fromkeys(range(4), 0), "")
