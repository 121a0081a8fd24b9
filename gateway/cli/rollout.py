"""`metaros rollout`: bring a version to many robots in waves, watch it, and stop it."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from metaros.cli.shared.gateway_http import GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted
from metaros.errors import UsageError

__all__ = ["register"]

Rollout = Annotated[str, typer.Argument(metavar="ROLLOUT", help="Its id, as `metaros rollout list` shows it.")]
Reason = Annotated[str, typer.Option("--reason", metavar="TEXT", help="Why, for whoever looks later.")]
Version = Annotated[str, typer.Argument(metavar="VERSION", help="A signed version, as 1.2.0.")]
Selector = Annotated[
    list[str] | None,
    typer.Option("-l", "--selector", metavar="TERM", help="Robots with label=value; more terms have to hold, too."),
]
Waves = Annotated[
    str, typer.Option("--waves", metavar="LIST", help="How many robots each wave has: 1,10%,50%,100% of all.")
]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(
        no_args_is_help=True, help="Rollouts: a version for many robots, in waves that halt by themselves."
    )
    commands = (
        ("start", _start),
        ("list", _list),
        ("show", _show),
        ("pause", _pause),
        ("resume", _resume),
        ("abort", _abort),
    )
    for name, command in commands:
        noun.command(name)(command)
    app.add_typer(noun, name="rollout")


def _start(
    version: Version,
    selector: Selector = None,
    every: Annotated[bool, typer.Option("--all", help="Every robot.")] = False,
    node: Annotated[str, typer.Option("--node", metavar="NAME", help="Of this node; default: of the agent.")] = "",
    bundle: Annotated[str, typer.Option("--bundle", metavar="NAME", help="The node's bundle; default: its name.")] = "",
    waves: Waves = "1,10%,50%,100%",
    max_failures: Annotated[
        float, typer.Option("--max-failures", min=0.0, max=1.0, metavar="RATE", help="Of a wave, before it halts.")
    ] = 0.1,
    health_s: Annotated[
        float, typer.Option("--health", min=1.0, metavar="S", help="A robot is healthy within so many seconds.")
    ] = 600.0,
    offline_s: Annotated[
        float, typer.Option("--offline", min=1.0, metavar="S", help="It may be offline meanwhile for so long.")
    ] = 300.0,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say which robots and waves there would be.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Bring a version to the robots that the selector names, wave after wave."""
    if bool(selector) == every:
        raise UsageError("say which robots: -l label=value, or --all")
    wanted = {
        "version": version,
        "selector": ", ".join(selector or ()),
        "node": node,
        "bundle": bundle,
        "waves": [text.strip() for text in waves.split(",")],
        "max_failure_rate": max_failures,
        "health_s": health_s,
        "offline_s": offline_s,
        "dry_run": dry_run,
    }
    made = open_gateway(gateway).post("/api/v1/rollouts", wanted)
    out = Output(output)
    if out.json:
        out.objects(made)
        return
    sizes = ", ".join(str(wave["size"]) for wave in made["waves"])
    out.line(f"{'(dry run) ' if dry_run else ''}{made['id']}: {counted(made['robots'], 'robot')} in waves of {sizes}")
    if not dry_run:
        out.note(f"watch it: metaros rollout show {made['id']}")


def _list(gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """The newest rollouts, and how far each is."""
    out = Output(output)
    found = open_gateway(gateway).get("/api/v1/rollouts")["rollouts"]
    if out.json:
        out.objects(found)
        return
    names = ("Rollout", "What", "State", "Wave", "Done", "Failed", "Robots", "Started")
    out.table(names, [_row(item) for item in found], empty="no rollout was started", right=(4, 5, 6))


def _row(item: dict[str, Any]) -> tuple[str, ...]:
    counts = item["counts"]
    what = f"{item['node'] or item['bundle']} {item['version']}"
    wave = f"{item['wave']}/{len(item['waves'])}"
    done, failed, robots = counts["done"], counts["failed"], item["robots"]
    return item["id"], what, item["state"], wave, str(done), str(failed), str(robots), item["created"][:16]


def _show(rollout: Rollout, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """One rollout: its waves, and each robot's state with the reason of a failure."""
    out = Output(output)
    found = open_gateway(gateway).get(f"/api/v1/rollouts/{path_part(rollout)}")
    if out.json:
        out.objects(found)
        return
    out.line(f"{found['node'] or found['bundle']} {found['version']}: {found['state']}")
    if found["reason"]:
        out.note(found["reason"])
    waves = [(w["wave"], w["size"], w["done"], w["failed"], w["in_flight"]) for w in found["waves"]]
    out.table(("Wave", "Robots", "Done", "Failed", "At it"), waves, right=(1, 2, 3, 4))
    rows = [(m["robot"], m["state"], m["wave"] or "–", m["since"][:19], m["reason"] or "–") for m in found["members"]]
    out.table(("Robot", "State", "Wave", "Since", "Reason"), rows)


def _pause(
    rollout: Rollout, reason: Reason = "", gateway: GatewayOption = "", output: FormatOption = Format.TEXT
) -> None:
    """Tell no further robot; those at it go on."""
    _act(rollout, "pause", {"reason": reason}, gateway, output)


def _resume(
    rollout: Rollout,
    version: Annotated[
        str, typer.Option("--version", metavar="VERSION", help="With this one instead, from the first wave.")
    ] = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Go on in spite of the failures so far, or with a version that mends them."""
    _act(rollout, "resume", {"version": version}, gateway, output)


def _abort(
    rollout: Rollout, reason: Reason = "", gateway: GatewayOption = "", output: FormatOption = Format.TEXT
) -> None:
    """End it. Robots that were told keep what their twins say."""
    _act(rollout, "abort", {"reason": reason}, gateway, output)


def _act(rollout: str, verb: str, body: dict[str, Any], gateway: str, output: Format) -> None:
    out = Output(output)
    done = open_gateway(gateway).post(f"/api/v1/rollouts/{path_part(rollout)}/{verb}", body)
    if out.json:
        out.objects(done)
        return
    out.line(f"{done['id']}: {done['state']}")
