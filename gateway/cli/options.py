"""Options that the gateway and the commands beside it share: where its stores are, and what it keeps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gateway.cli.data_dir import gateway_dir

__all__ = [
    "Cluster",
    "DataDir",
    "EventRetentionDays",
    "MasterKeyFile",
    "ObjectsUrl",
    "RetentionDays",
    "RetentionMib",
    "RetentionRules",
    "StoreUrl",
]

DataDir = Annotated[
    Path | None,
    typer.Option(file_okay=False, callback=gateway_dir, help="Where data is kept; default ~/.metaros/gateway."),
]
StoreUrl = Annotated[
    str,
    typer.Option(
        "--store",
        metavar="URL",
        envvar="METAROS_STORE",
        show_envvar=False,
        help="postgresql://user@host/database instead of a file in the data directory.",
    ),
]
ObjectsUrl = Annotated[
    str,
    typer.Option(
        "--objects",
        metavar="URL",
        envvar="METAROS_OBJECTS",
        show_envvar=False,
        help="s3://bucket/prefix or file:///folder instead of a directory in the data directory.",
    ),
]
Cluster = Annotated[
    str,
    typer.Option(
        "--cluster",
        metavar="ENDPOINT,…",
        envvar="METAROS_CLUSTER",
        show_envvar=False,
        help="Zenoh routers by which the gateways of one PostgreSQL reach each other, as tcp/host:7447.",
    ),
]
MasterKeyFile = Annotated[
    Path | None,
    typer.Option(
        "--master-key",
        dir_okay=False,
        metavar="FILE",
        envvar="METAROS_MASTER_KEY",
        show_envvar=False,
        help="The key that seals secrets, for gateways that share it; default master.key in the data directory.",
    ),
]
RetentionDays = Annotated[float, typer.Option(min=0.01, help="How long series and messages are kept.")]
EventRetentionDays = Annotated[float, typer.Option(min=0.01, help="How long events and the record of losses are kept.")]
RetentionMib = Annotated[int, typer.Option(min=1, help="How large the store may grow before the oldest data goes.")]
RetentionRules = Annotated[
    list[str] | None,
    typer.Option(
        "--retention",
        metavar="CLASS=AGE,SIZE",
        help="Bounds of metric, bulk, event or recording: bulk=3d,20GiB or metric=30d; repeat it for more.",
    ),
]
