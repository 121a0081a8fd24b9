"""The messages of rmw_dds_common."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Message

class Gid(Message):
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class NodeEntitiesInfo(Message):
    node_namespace: str
    node_name: str
    reader_gid_seq: list[Gid]
    writer_gid_seq: list[Gid]
    def __init__(
        self,
        *,
        node_namespace: str = ...,
        node_name: str = ...,
        reader_gid_seq: list[Gid] = ...,
        writer_gid_seq: list[Gid] = ...,
    ) -> None: ...

class ParticipantEntitiesInfo(Message):
    gid: Gid
    node_entities_info_seq: list[NodeEntitiesInfo]
    def __init__(
        self,
        *,
        gid: Gid = ...,
        node_entities_info_seq: list[NodeEntitiesInfo] = ...,
    ) -> None: ...
