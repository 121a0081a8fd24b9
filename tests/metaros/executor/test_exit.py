"""A program ends although a callback blocks, on every executor that has threads of its own."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import threading
import metaros

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


@pytest.mark.parametrize("ending", ["context.close()", ""])
@pytest.mark.parametrize(
    ("executor", "options"), [("metaros.MultiThreadedExecutor()", ""), ("metaros.FairExecutor()", ", critical=True")]
)
def test_a_blocked_callback_does_not_hold_up_the_programs_end(executor: str, options: str, ending: str) -> None:
    code = PROGRAM.format(executor=executor, options=options, ending=ending)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
