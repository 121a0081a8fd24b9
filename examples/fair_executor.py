"""Three nodes that compute share one thread by their nice levels; a critical one keeps its 100 Hz beside them.

`--seconds N` ends after N seconds and prints who got how much.
"""

from __future__ import annotations

import argparse
import threading
import time

import metaros

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--seconds", type=float, default=5.0, help="how long to run")
seconds = parser.parse_args().seconds

executor = metaros.FairExecutor()
for name, nice in (("planner", -5), ("mapper", 0), ("logger", 5)):
    node = metaros.Node(name, nice=nice)
    executor.add_node(node)

    @node.timer(0.001)
    def compute() -> None:
        end_s = time.thread_time() + 0.002
        while time.thread_time() < end_s:
            pass


control = metaros.Node("control", critical=True)
executor.add_node(control)
ticks = control.create_timer(0.01, lambda: None)

threading.Timer(seconds, executor.shutdown).start()
executor.spin()
for row in executor.report():
    what = f"real-time class: {row.realtime}" if row.critical else f"nice {row.nice:>2}: {row.share:6.1%} of the thread"
    print(f"{row.name:<10}{what}")
print(f"control was called {ticks.statistics.calls} times, {ticks.statistics.max_lateness_s * 1e3:.2f} ms late at most")
