"""`metaros topic info` names the publishers and subscriptions that do not fit together."""

from __future__ import annotations

import json

import metaros
from metaros.cli.shared.options import Format
from metaros.cli.shared.output import Output
from metaros.cli.topic.incompatibilities import print_problems
from metaros.interfaces.std_msgs.msg import String
from metaros.wire import QoSProfile, Reliability
from tests.metaros.cli.conftest import Reported, Run


def test_pairs_at_odds_are_shown(run: Run, zenoh_router: str, told: Reported) -> None:
    with metaros.Context(domain_id=0, connect=zenoh_router) as context:
        talker, listener = metaros.Node("talker", context=context), metaros.Node("listener", context=context)
        talker.create_publisher(String, "/t", QoSProfile(reliability=Reliability.BEST_EFFORT))
        talker.create_raw_publisher("/t", "std_msgs/msg/String", "RIHS01_" + "0" * 64)
        listener.create_subscription(String, "/t", print)
        told("/t", ends=3)
        done = run("topic", "info", "/t", "-v")
        assert "Incompatible: 2\n" in done.out
        reason = "publisher /talker and subscription /listener: reliability: best_effort is offered, reliable requested"
        assert f"  qos_mismatch: /t: {reason}\n" in done.out
        assert "  type_hash_mismatch: /t: publisher /talker and subscription /listener" in done.out
        brief = run("topic", "info", "/t")
        assert "do not fit together: 2 (see -v)" in brief.err
        assert "Incompatible" not in brief.out
        facts = json.loads(run("topic", "info", "/t", "-o", "json").out)
    assert [(item["code"], item["policies"]) for item in facts["incompatible"]] == [
        ("qos_mismatch", ["reliability"]),
        ("type_hash_mismatch", []),
    ]
    assert {(item["publisher"], item["subscriber"]) for item in facts["incompatible"]} == {("/talker", "/listener")}


def test_a_long_list_is_cut(capsys) -> None:
    problem = {"code": "qos_mismatch", "text": "x"}
    print_problems(Output(Format.TEXT), [problem] * 23, verbose=True)
    lines = capsys.readouterr().out.splitlines()
    assert (lines[1], lines[-1], len(lines)) == ("Incompatible: 23", "  and 3 more", 23)
    print_problems(Output(Format.TEXT), [], verbose=True)
    assert capsys.readouterr().out == ""
