"""The drawn graph: an XML document with everything in it; and the command that draws a real one."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import metaros
from metaros.cli.graph.model import Fault, GraphModel, Link, build_graph_model
from metaros.cli.graph.svg import svg
from metaros.cli.graph.text import mermaid
from metaros.cli.shared.topic_rates import TopicRates
from metaros.interfaces.std_msgs.msg import String
from tests.metaros.cli.conftest import Run
from tests.metaros.cli.graph.test_model import BEST_EFFORT, end
from tests.support.processes.command_line import program
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until

SVG = "{http://www.w3.org/2000/svg}"


def parsed(document: str) -> ElementTree.Element:
    """The document, which must be XML and SVG."""
    root = ElementTree.fromstring(document)
    assert root.tag == f"{SVG}svg"
    return root


def texts(root: ElementTree.Element) -> list[str]:
    """What stands in the picture."""
    return [item.text or "" for item in root.iter(f"{SVG}text")]


def titles(root: ElementTree.Element) -> list[str]:
    """What stands under the pointer."""
    return [item.text or "" for item in root.iter(f"{SVG}title")]


def test_nodes_topics_rates_and_namespaces() -> None:
    tokens = [end("talker", "MP", "/chatter"), end("ear", "MS", "/chatter")]
    root = parsed(
        svg(build_graph_model(["/talker", "/ear", "/sim_1/base"], tokens), {"/chatter": TopicRates(20.0, 512.0)})
    )
    shown = texts(root)
    assert {"/talker", "/ear", "/chatter", "std_msgs/String", "20.0 Hz", "/sim_1", "base"} <= set(shown)
    (about,) = (title for title in titles(root) if title.startswith("topic /chatter"))
    assert "20.0 Hz, 512 B/s" in about
    assert "publisher /talker: RELIABLE, VOLATILE, KEEP_LAST" in about
    assert len([path for path in root.iter(f"{SVG}path") if "arc" in (path.get("class") or "")]) == 2


def test_a_topic_that_says_nothing_is_silent_only_where_it_was_measured() -> None:
    picture = build_graph_model(["/talker"], [end("talker", "MP", "/chatter")])
    assert "silent" in texts(parsed(svg(picture, {})))
    assert "silent" not in texts(parsed(svg(picture)))


def test_mismatches_are_red_and_reported_below() -> None:
    tokens = [
        end("talker", "MP", "/chatter", qos=BEST_EFFORT),
        end("deaf", "MS", "/chatter"),
        end("ear", "MS", "/chatter", qos=BEST_EFFORT),
    ]
    root = parsed(svg(build_graph_model(["/talker", "/deaf", "/ear"], tokens)))
    arcs = [path.get("class") for path in root.iter(f"{SVG}path") if "arc" in (path.get("class") or "")]
    assert sorted(arc.strip() for arc in arcs if arc) == ["arc", "arc", "arc fault"]
    assert any("/talker → /deaf: reliability: best_effort is offered" in text for text in texts(root))


def test_who_waits_in_vain_and_who_hears_itself() -> None:
    tokens = [end("ear", "MS", "/silence"), end("ear", "MP", "/echo"), end("ear", "MS", "/echo")]
    document = svg(build_graph_model(["/ear"], tokens))
    assert "nobody publishes" in texts(parsed(document))
    assert document.count("marker-start") == 1


def test_any_text_is_escaped() -> None:
    evil = 'x"><script>alert(1)</script>&\x00\x1b]'
    link = Link("topic", f"/{evil}", (evil,), (f"/{evil}",), ("/b",), (Fault("qos_mismatch", f"/{evil}", "/b", evil),))
    root = parsed(svg(GraphModel((f"/{evil}", "/b"), (link,)), heading=evil))
    assert [item.tag for item in root.iter() if "script" in item.tag] == []
    assert any("<script>" in text for text in texts(root))


def test_the_names_of_hundreds_fit_and_nothing_refers_remote() -> None:
    tokens = [end(f"n{i}", "MP", f"/ns_{i % 7}/{'long_' * 20}{i}") for i in range(120)]
    document = svg(build_graph_model([f"/n{i}" for i in range(120)], tokens))
    assert max(map(len, texts(parsed(document)))) < 60
    assert re.findall(r"(?:href|src)=|url\((?!#)|@import|https?://(?!www\.w3\.org/2000/svg)", document) == []


def test_an_empty_graph_is_a_picture_too() -> None:
    parsed(svg(GraphModel((), ())))


def test_mermaid() -> None:
    tokens = [end("talker", "MP", "/chatter", qos=BEST_EFFORT), end("deaf", "MS", "/chatter")]
    lines = list(mermaid(build_graph_model(["/talker", "/deaf"], tokens)))
    assert lines[0] == "flowchart LR"
    assert '  n1(["/talker"])' in lines
    assert "  n1 --> t0" in lines
    assert "  t0 --> n0" not in lines
    assert any(line.startswith('  n1 -. "✗ reliability') for line in lines)


def test_the_command_draws_a_running_graph(run: Run, talker: metaros.Node, tmp_path: Path, zenoh_port: str) -> None:
    file = tmp_path / "graph.svg"
    received: list[String] = []
    talker.create_subscription(String, "/chatter", received.append, 10)
    wait_until(lambda: received)
    done = run("graph", "--svg", str(file), "--measure", "0.3")
    assert (done.code, done.out, done.err) == (0, "", f"drawn: {file}\n")
    shown = texts(parsed(file.read_text(encoding="utf-8")))
    assert {"/chatter", "/demo", "talker"} <= set(shown)
    assert any(text.endswith(" Hz") for text in shown)
    assert "/demo/talker/reset" not in shown
    shown = texts(parsed(run("graph", "--svg", "--measure", "0", "--services").out))
    assert "talker/reset" in shown
    with started(program("graph", "-o", "mermaid", "--zenoh-port", zenoh_port)) as process:
        assert process.communicate(timeout=END_S)[0].startswith("flowchart LR\n")


def test_a_file_that_is_no_svg_is_refused(run: Run, tmp_path: Path) -> None:
    done = run("graph", "--svg", "/sim_1")
    assert done.code == 2
    assert "metaros graph /sim_1 --svg" in done.err
    done = run("graph", "--svg", str(tmp_path / "nowhere" / "graph.svg"))
    assert (done.code, "no directory" in done.err) == (2, True)
