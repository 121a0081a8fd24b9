"""Send a goal to /fibonacci, print feedback and result. `--cancel-after N` stops it after N pieces of feedback."""

from __future__ import annotations

import argparse
import threading

import metaros
from metaros.interfaces.example_interfaces.action import Fibonacci

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--order", type=int, default=5)
parser.add_argument("--cancel-after", type=int, default=0, metavar="N")
options = parser.parse_args()

with metaros.Node("fibonacci_client") as node:
    client = node.create_action_client(Fibonacci, "fibonacci")
    enough = threading.Event()
    pieces = 0

    def on_feedback(feedback: Fibonacci.Feedback) -> None:
        global pieces
        pieces += 1
        print(f"so far: {feedback.sequence.tolist()}")
        if pieces == options.cancel_after:
            enough.set()

    threading.Thread(target=metaros.spin, args=(node,), daemon=True).start()  # for feedback
    if not client.wait_for_server(timeout_s=10):
        raise SystemExit("no server of /fibonacci: start examples/fibonacci_server.py")
    goal = client.send_goal(Fibonacci.Goal(order=options.order), feedback=on_feedback).wait()
    if not goal.accepted:
        raise SystemExit("the server does not want this goal")
    if options.cancel_after and enough.wait(60):
        print(f"cancel: {'granted' if goal.cancel().wait() else 'refused'}")
    status, result = goal.result().wait()
    print(f"{status.name}: {result.sequence.tolist()}")
