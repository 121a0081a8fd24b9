from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Lane(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    LANE_UNSPECIFIED: _ClassVar[Lane]
    LANE_CONTROL: _ClassVar[Lane]
    LANE_DATA: _ClassVar[Lane]
    LANE_BACKFILL: _ClassVar[Lane]

class DeliveryClass(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    DELIVERY_CLASS_UNSPECIFIED: _ClassVar[DeliveryClass]
    DELIVERY_CLASS_EVENT: _ClassVar[DeliveryClass]
    DELIVERY_CLASS_METRIC: _ClassVar[DeliveryClass]
    DELIVERY_CLASS_BULK: _ClassVar[DeliveryClass]
    DELIVERY_CLASS_LIVE: _ClassVar[DeliveryClass]

class Compression(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    COMPRESSION_NONE: _ClassVar[Compression]
    COMPRESSION_ZSTD: _ClassVar[Compression]

class EndpointKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ENDPOINT_KIND_UNSPECIFIED: _ClassVar[EndpointKind]
    ENDPOINT_KIND_PUBLISHER: _ClassVar[EndpointKind]
    ENDPOINT_KIND_SUBSCRIPTION: _ClassVar[EndpointKind]
    ENDPOINT_KIND_SERVER: _ClassVar[EndpointKind]
    ENDPOINT_KIND_CLIENT: _ClassVar[EndpointKind]
LANE_UNSPECIFIED: Lane
LANE_CONTROL: Lane
LANE_DATA: Lane
LANE_BACKFILL: Lane
DELIVERY_CLASS_UNSPECIFIED: DeliveryClass
DELIVERY_CLASS_EVENT: DeliveryClass
DELIVERY_CLASS_METRIC: DeliveryClass
DELIVERY_CLASS_BULK: DeliveryClass
DELIVERY_CLASS_LIVE: DeliveryClass
COMPRESSION_NONE: Compression
COMPRESSION_ZSTD: Compression
ENDPOINT_KIND_UNSPECIFIED: EndpointKind
ENDPOINT_KIND_PUBLISHER: EndpointKind
ENDPOINT_KIND_SUBSCRIPTION: EndpointKind
ENDPOINT_KIND_SERVER: EndpointKind
ENDPOINT_KIND_CLIENT: EndpointKind

class AgentFrame(_message.Message):
    __slots__ = ("hello", "announce", "batches", "metrics", "gap", "statistics", "result", "heartbeat", "resumed", "recording", "proof", "twin", "leases_taken", "graph", "goals", "offer_states", "asked")
    HELLO_FIELD_NUMBER: _ClassVar[int]
    ANNOUNCE_FIELD_NUMBER: _ClassVar[int]
    BATCHES_FIELD_NUMBER: _ClassVar[int]
    METRICS_FIELD_NUMBER: _ClassVar[int]
    GAP_FIELD_NUMBER: _ClassVar[int]
    STATISTICS_FIELD_NUMBER: _ClassVar[int]
    RESULT_FIELD_NUMBER: _ClassVar[int]
    HEARTBEAT_FIELD_NUMBER: _ClassVar[int]
    RESUMED_FIELD_NUMBER: _ClassVar[int]
    RECORDING_FIELD_NUMBER: _ClassVar[int]
    PROOF_FIELD_NUMBER: _ClassVar[int]
    TWIN_FIELD_NUMBER: _ClassVar[int]
    LEASES_TAKEN_FIELD_NUMBER: _ClassVar[int]
    GRAPH_FIELD_NUMBER: _ClassVar[int]
    GOALS_FIELD_NUMBER: _ClassVar[int]
    OFFER_STATES_FIELD_NUMBER: _ClassVar[int]
    ASKED_FIELD_NUMBER: _ClassVar[int]
    hello: Hello
    announce: Announce
    batches: Batches
    metrics: MetricBatch
    gap: Gap
    statistics: TopicStatistics
    result: CommandResult
    heartbeat: Heartbeat
    resumed: Resumed
    recording: RecordingPart
    proof: Proof
    twin: TwinReport
    leases_taken: LeasesTaken
    graph: GraphReport
    goals: GoalEvents
    offer_states: OfferStates
    asked: OfferAsked
    def __init__(self, hello: _Optional[_Union[Hello, _Mapping]] = ..., announce: _Optional[_Union[Announce, _Mapping]] = ..., batches: _Optional[_Union[Batches, _Mapping]] = ..., metrics: _Optional[_Union[MetricBatch, _Mapping]] = ..., gap: _Optional[_Union[Gap, _Mapping]] = ..., statistics: _Optional[_Union[TopicStatistics, _Mapping]] = ..., result: _Optional[_Union[CommandResult, _Mapping]] = ..., heartbeat: _Optional[_Union[Heartbeat, _Mapping]] = ..., resumed: _Optional[_Union[Resumed, _Mapping]] = ..., recording: _Optional[_Union[RecordingPart, _Mapping]] = ..., proof: _Optional[_Union[Proof, _Mapping]] = ..., twin: _Optional[_Union[TwinReport, _Mapping]] = ..., leases_taken: _Optional[_Union[LeasesTaken, _Mapping]] = ..., graph: _Optional[_Union[GraphReport, _Mapping]] = ..., goals: _Optional[_Union[GoalEvents, _Mapping]] = ..., offer_states: _Optional[_Union[OfferStates, _Mapping]] = ..., asked: _Optional[_Union[OfferAsked, _Mapping]] = ...) -> None: ...

class GatewayFrame(_message.Message):
    __slots__ = ("welcome", "ack", "demand", "command", "teleop", "heartbeat", "goodbye", "retry_later", "recording_wanted", "challenge", "twin", "twin_confirmed", "node_leases", "result_stored", "offers", "offer_answer", "talk")
    WELCOME_FIELD_NUMBER: _ClassVar[int]
    ACK_FIELD_NUMBER: _ClassVar[int]
    DEMAND_FIELD_NUMBER: _ClassVar[int]
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    TELEOP_FIELD_NUMBER: _ClassVar[int]
    HEARTBEAT_FIELD_NUMBER: _ClassVar[int]
    GOODBYE_FIELD_NUMBER: _ClassVar[int]
    RETRY_LATER_FIELD_NUMBER: _ClassVar[int]
    RECORDING_WANTED_FIELD_NUMBER: _ClassVar[int]
    CHALLENGE_FIELD_NUMBER: _ClassVar[int]
    TWIN_FIELD_NUMBER: _ClassVar[int]
    TWIN_CONFIRMED_FIELD_NUMBER: _ClassVar[int]
    NODE_LEASES_FIELD_NUMBER: _ClassVar[int]
    RESULT_STORED_FIELD_NUMBER: _ClassVar[int]
    OFFERS_FIELD_NUMBER: _ClassVar[int]
    OFFER_ANSWER_FIELD_NUMBER: _ClassVar[int]
    TALK_FIELD_NUMBER: _ClassVar[int]
    welcome: Welcome
    ack: Ack
    demand: Demand
    command: Command
    teleop: Teleop
    heartbeat: Heartbeat
    goodbye: Goodbye
    retry_later: RetryLater
    recording_wanted: RecordingWanted
    challenge: Challenge
    twin: TwinDesired
    twin_confirmed: TwinConfirmed
    node_leases: NodeLeases
    result_stored: ResultStored
    offers: Offers
    offer_answer: OfferAnswer
    talk: Teleop
    def __init__(self, welcome: _Optional[_Union[Welcome, _Mapping]] = ..., ack: _Optional[_Union[Ack, _Mapping]] = ..., demand: _Optional[_Union[Demand, _Mapping]] = ..., command: _Optional[_Union[Command, _Mapping]] = ..., teleop: _Optional[_Union[Teleop, _Mapping]] = ..., heartbeat: _Optional[_Union[Heartbeat, _Mapping]] = ..., goodbye: _Optional[_Union[Goodbye, _Mapping]] = ..., retry_later: _Optional[_Union[RetryLater, _Mapping]] = ..., recording_wanted: _Optional[_Union[RecordingWanted, _Mapping]] = ..., challenge: _Optional[_Union[Challenge, _Mapping]] = ..., twin: _Optional[_Union[TwinDesired, _Mapping]] = ..., twin_confirmed: _Optional[_Union[TwinConfirmed, _Mapping]] = ..., node_leases: _Optional[_Union[NodeLeases, _Mapping]] = ..., result_stored: _Optional[_Union[ResultStored, _Mapping]] = ..., offers: _Optional[_Union[Offers, _Mapping]] = ..., offer_answer: _Optional[_Union[OfferAnswer, _Mapping]] = ..., talk: _Optional[_Union[Teleop, _Mapping]] = ...) -> None: ...

class Hello(_message.Message):
    __slots__ = ("protocol", "robot_id", "session_id", "session_number", "lane", "agent_version", "namespace", "hostname", "labels", "streams", "writers", "epochs", "certificates")
    class LabelsEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    PROTOCOL_FIELD_NUMBER: _ClassVar[int]
    ROBOT_ID_FIELD_NUMBER: _ClassVar[int]
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    SESSION_NUMBER_FIELD_NUMBER: _ClassVar[int]
    LANE_FIELD_NUMBER: _ClassVar[int]
    AGENT_VERSION_FIELD_NUMBER: _ClassVar[int]
    NAMESPACE_FIELD_NUMBER: _ClassVar[int]
    HOSTNAME_FIELD_NUMBER: _ClassVar[int]
    LABELS_FIELD_NUMBER: _ClassVar[int]
    STREAMS_FIELD_NUMBER: _ClassVar[int]
    WRITERS_FIELD_NUMBER: _ClassVar[int]
    EPOCHS_FIELD_NUMBER: _ClassVar[int]
    CERTIFICATES_FIELD_NUMBER: _ClassVar[int]
    protocol: int
    robot_id: str
    session_id: bytes
    session_number: int
    lane: Lane
    agent_version: str
    namespace: str
    hostname: str
    labels: _containers.ScalarMap[str, str]
    streams: _containers.RepeatedCompositeFieldContainer[StreamState]
    writers: _containers.RepeatedScalarFieldContainer[str]
    epochs: _containers.RepeatedScalarFieldContainer[int]
    certificates: _containers.RepeatedScalarFieldContainer[bytes]
    def __init__(self, protocol: _Optional[int] = ..., robot_id: _Optional[str] = ..., session_id: _Optional[bytes] = ..., session_number: _Optional[int] = ..., lane: _Optional[_Union[Lane, str]] = ..., agent_version: _Optional[str] = ..., namespace: _Optional[str] = ..., hostname: _Optional[str] = ..., labels: _Optional[_Mapping[str, str]] = ..., streams: _Optional[_Iterable[_Union[StreamState, _Mapping]]] = ..., writers: _Optional[_Iterable[str]] = ..., epochs: _Optional[_Iterable[int]] = ..., certificates: _Optional[_Iterable[bytes]] = ...) -> None: ...

class Challenge(_message.Message):
    __slots__ = ("nonce", "audience")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    AUDIENCE_FIELD_NUMBER: _ClassVar[int]
    nonce: bytes
    audience: str
    def __init__(self, nonce: _Optional[bytes] = ..., audience: _Optional[str] = ...) -> None: ...

class Proof(_message.Message):
    __slots__ = ("signature",)
    SIGNATURE_FIELD_NUMBER: _ClassVar[int]
    signature: bytes
    def __init__(self, signature: _Optional[bytes] = ...) -> None: ...

class StreamState(_message.Message):
    __slots__ = ("stream_id", "epoch", "first_seq", "last_seq", "base_seq")
    STREAM_ID_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    FIRST_SEQ_FIELD_NUMBER: _ClassVar[int]
    LAST_SEQ_FIELD_NUMBER: _ClassVar[int]
    BASE_SEQ_FIELD_NUMBER: _ClassVar[int]
    stream_id: int
    epoch: int
    first_seq: int
    last_seq: int
    base_seq: int
    def __init__(self, stream_id: _Optional[int] = ..., epoch: _Optional[int] = ..., first_seq: _Optional[int] = ..., last_seq: _Optional[int] = ..., base_seq: _Optional[int] = ...) -> None: ...

class Welcome(_message.Message):
    __slots__ = ("gateway_id", "store_id", "watermarks", "window_bytes", "window_batches", "heartbeat_s", "stored_writers", "fetch_token", "twin", "graph")
    GATEWAY_ID_FIELD_NUMBER: _ClassVar[int]
    STORE_ID_FIELD_NUMBER: _ClassVar[int]
    WATERMARKS_FIELD_NUMBER: _ClassVar[int]
    WINDOW_BYTES_FIELD_NUMBER: _ClassVar[int]
    WINDOW_BATCHES_FIELD_NUMBER: _ClassVar[int]
    HEARTBEAT_S_FIELD_NUMBER: _ClassVar[int]
    STORED_WRITERS_FIELD_NUMBER: _ClassVar[int]
    FETCH_TOKEN_FIELD_NUMBER: _ClassVar[int]
    TWIN_FIELD_NUMBER: _ClassVar[int]
    GRAPH_FIELD_NUMBER: _ClassVar[int]
    gateway_id: str
    store_id: str
    watermarks: _containers.RepeatedCompositeFieldContainer[Watermark]
    window_bytes: int
    window_batches: int
    heartbeat_s: float
    stored_writers: _containers.RepeatedCompositeFieldContainer[EpochWriter]
    fetch_token: str
    twin: bool
    graph: bool
    def __init__(self, gateway_id: _Optional[str] = ..., store_id: _Optional[str] = ..., watermarks: _Optional[_Iterable[_Union[Watermark, _Mapping]]] = ..., window_bytes: _Optional[int] = ..., window_batches: _Optional[int] = ..., heartbeat_s: _Optional[float] = ..., stored_writers: _Optional[_Iterable[_Union[EpochWriter, _Mapping]]] = ..., fetch_token: _Optional[str] = ..., twin: _Optional[bool] = ..., graph: _Optional[bool] = ...) -> None: ...

class EpochWriter(_message.Message):
    __slots__ = ("epoch", "writer")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    WRITER_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    writer: str
    def __init__(self, epoch: _Optional[int] = ..., writer: _Optional[str] = ...) -> None: ...

class Watermark(_message.Message):
    __slots__ = ("stream_id", "epoch", "seq")
    STREAM_ID_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    stream_id: int
    epoch: int
    seq: int
    def __init__(self, stream_id: _Optional[int] = ..., epoch: _Optional[int] = ..., seq: _Optional[int] = ...) -> None: ...

class Ack(_message.Message):
    __slots__ = ("watermarks",)
    WATERMARKS_FIELD_NUMBER: _ClassVar[int]
    watermarks: _containers.RepeatedCompositeFieldContainer[Watermark]
    def __init__(self, watermarks: _Optional[_Iterable[_Union[Watermark, _Mapping]]] = ...) -> None: ...

class Announce(_message.Message):
    __slots__ = ("channels", "series")
    CHANNELS_FIELD_NUMBER: _ClassVar[int]
    SERIES_FIELD_NUMBER: _ClassVar[int]
    channels: _containers.RepeatedCompositeFieldContainer[Channel]
    series: _containers.RepeatedCompositeFieldContainer[Series]
    def __init__(self, channels: _Optional[_Iterable[_Union[Channel, _Mapping]]] = ..., series: _Optional[_Iterable[_Union[Series, _Mapping]]] = ...) -> None: ...

class Channel(_message.Message):
    __slots__ = ("channel_id", "topic", "encoding", "schema_name", "schema_encoding", "schema", "type_hash", "qos", "max_rate_hz", "forward", "history", "history_rate_hz")
    CHANNEL_ID_FIELD_NUMBER: _ClassVar[int]
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    SCHEMA_NAME_FIELD_NUMBER: _ClassVar[int]
    SCHEMA_ENCODING_FIELD_NUMBER: _ClassVar[int]
    SCHEMA_FIELD_NUMBER: _ClassVar[int]
    TYPE_HASH_FIELD_NUMBER: _ClassVar[int]
    QOS_FIELD_NUMBER: _ClassVar[int]
    CLASS_FIELD_NUMBER: _ClassVar[int]
    MAX_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    FORWARD_FIELD_NUMBER: _ClassVar[int]
    HISTORY_FIELD_NUMBER: _ClassVar[int]
    HISTORY_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    channel_id: int
    topic: str
    encoding: str
    schema_name: str
    schema_encoding: str
    schema: bytes
    type_hash: str
    qos: str
    max_rate_hz: float
    forward: bool
    history: bool
    history_rate_hz: float
    def __init__(self, channel_id: _Optional[int] = ..., topic: _Optional[str] = ..., encoding: _Optional[str] = ..., schema_name: _Optional[str] = ..., schema_encoding: _Optional[str] = ..., schema: _Optional[bytes] = ..., type_hash: _Optional[str] = ..., qos: _Optional[str] = ..., max_rate_hz: _Optional[float] = ..., forward: _Optional[bool] = ..., history: _Optional[bool] = ..., history_rate_hz: _Optional[float] = ..., **kwargs) -> None: ...

class Series(_message.Message):
    __slots__ = ("series_id", "name", "topic", "field")
    SERIES_ID_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    FIELD_FIELD_NUMBER: _ClassVar[int]
    series_id: int
    name: str
    topic: str
    field: str
    def __init__(self, series_id: _Optional[int] = ..., name: _Optional[str] = ..., topic: _Optional[str] = ..., field: _Optional[str] = ...) -> None: ...

class Batches(_message.Message):
    __slots__ = ("batches",)
    BATCHES_FIELD_NUMBER: _ClassVar[int]
    batches: _containers.RepeatedCompositeFieldContainer[Batch]
    def __init__(self, batches: _Optional[_Iterable[_Union[Batch, _Mapping]]] = ...) -> None: ...

class Batch(_message.Message):
    __slots__ = ("stream_id", "epoch", "first_seq", "count", "stamps", "lengths", "payload", "chunk_index", "chunk_count", "compression", "trace")
    STREAM_ID_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    FIRST_SEQ_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    STAMPS_FIELD_NUMBER: _ClassVar[int]
    LENGTHS_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_FIELD_NUMBER: _ClassVar[int]
    CHUNK_INDEX_FIELD_NUMBER: _ClassVar[int]
    CHUNK_COUNT_FIELD_NUMBER: _ClassVar[int]
    COMPRESSION_FIELD_NUMBER: _ClassVar[int]
    TRACE_FIELD_NUMBER: _ClassVar[int]
    stream_id: int
    epoch: int
    first_seq: int
    count: int
    stamps: bytes
    lengths: bytes
    payload: bytes
    chunk_index: int
    chunk_count: int
    compression: Compression
    trace: SampleTrace
    def __init__(self, stream_id: _Optional[int] = ..., epoch: _Optional[int] = ..., first_seq: _Optional[int] = ..., count: _Optional[int] = ..., stamps: _Optional[bytes] = ..., lengths: _Optional[bytes] = ..., payload: _Optional[bytes] = ..., chunk_index: _Optional[int] = ..., chunk_count: _Optional[int] = ..., compression: _Optional[_Union[Compression, str]] = ..., trace: _Optional[_Union[SampleTrace, _Mapping]] = ...) -> None: ...

class SampleTrace(_message.Message):
    __slots__ = ("seq", "traceparent", "tapped_ns", "taken_ns", "accepted_ns", "sent_ns", "clock_offset_ns")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    TRACEPARENT_FIELD_NUMBER: _ClassVar[int]
    TAPPED_NS_FIELD_NUMBER: _ClassVar[int]
    TAKEN_NS_FIELD_NUMBER: _ClassVar[int]
    ACCEPTED_NS_FIELD_NUMBER: _ClassVar[int]
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    CLOCK_OFFSET_NS_FIELD_NUMBER: _ClassVar[int]
    seq: int
    traceparent: str
    tapped_ns: int
    taken_ns: int
    accepted_ns: int
    sent_ns: int
    clock_offset_ns: int
    def __init__(self, seq: _Optional[int] = ..., traceparent: _Optional[str] = ..., tapped_ns: _Optional[int] = ..., taken_ns: _Optional[int] = ..., accepted_ns: _Optional[int] = ..., sent_ns: _Optional[int] = ..., clock_offset_ns: _Optional[int] = ...) -> None: ...

class MetricBatch(_message.Message):
    __slots__ = ("epoch", "first_seq", "count", "series_ids", "stamps", "values", "stream_id")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    FIRST_SEQ_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    SERIES_IDS_FIELD_NUMBER: _ClassVar[int]
    STAMPS_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    STREAM_ID_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    first_seq: int
    count: int
    series_ids: bytes
    stamps: bytes
    values: bytes
    stream_id: int
    def __init__(self, epoch: _Optional[int] = ..., first_seq: _Optional[int] = ..., count: _Optional[int] = ..., series_ids: _Optional[bytes] = ..., stamps: _Optional[bytes] = ..., values: _Optional[bytes] = ..., stream_id: _Optional[int] = ...) -> None: ...

class Gap(_message.Message):
    __slots__ = ("stream_id", "epoch", "from_seq", "to_seq", "reason", "from_ns", "to_ns")
    STREAM_ID_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    FROM_SEQ_FIELD_NUMBER: _ClassVar[int]
    TO_SEQ_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    FROM_NS_FIELD_NUMBER: _ClassVar[int]
    TO_NS_FIELD_NUMBER: _ClassVar[int]
    stream_id: int
    epoch: int
    from_seq: int
    to_seq: int
    reason: str
    from_ns: int
    to_ns: int
    def __init__(self, stream_id: _Optional[int] = ..., epoch: _Optional[int] = ..., from_seq: _Optional[int] = ..., to_seq: _Optional[int] = ..., reason: _Optional[str] = ..., from_ns: _Optional[int] = ..., to_ns: _Optional[int] = ...) -> None: ...

class TopicStatistics(_message.Message):
    __slots__ = ("topics", "outbox_bytes", "outbox_samples", "malformed", "link")
    TOPICS_FIELD_NUMBER: _ClassVar[int]
    OUTBOX_BYTES_FIELD_NUMBER: _ClassVar[int]
    OUTBOX_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    MALFORMED_FIELD_NUMBER: _ClassVar[int]
    LINK_FIELD_NUMBER: _ClassVar[int]
    topics: _containers.RepeatedCompositeFieldContainer[TopicRate]
    outbox_bytes: int
    outbox_samples: int
    malformed: int
    link: LinkStatistics
    def __init__(self, topics: _Optional[_Iterable[_Union[TopicRate, _Mapping]]] = ..., outbox_bytes: _Optional[int] = ..., outbox_samples: _Optional[int] = ..., malformed: _Optional[int] = ..., link: _Optional[_Union[LinkStatistics, _Mapping]] = ...) -> None: ...

class LinkStatistics(_message.Message):
    __slots__ = ("transport", "gateway", "budget_bytes_per_s", "sent_bytes_per_s", "reconnects", "classes", "disk_free_bytes", "clock_offset_ns", "black_box")
    TRANSPORT_FIELD_NUMBER: _ClassVar[int]
    GATEWAY_FIELD_NUMBER: _ClassVar[int]
    BUDGET_BYTES_PER_S_FIELD_NUMBER: _ClassVar[int]
    SENT_BYTES_PER_S_FIELD_NUMBER: _ClassVar[int]
    RECONNECTS_FIELD_NUMBER: _ClassVar[int]
    CLASSES_FIELD_NUMBER: _ClassVar[int]
    DISK_FREE_BYTES_FIELD_NUMBER: _ClassVar[int]
    CLOCK_OFFSET_NS_FIELD_NUMBER: _ClassVar[int]
    BLACK_BOX_FIELD_NUMBER: _ClassVar[int]
    transport: str
    gateway: str
    budget_bytes_per_s: int
    sent_bytes_per_s: float
    reconnects: int
    classes: _containers.RepeatedCompositeFieldContainer[ClassDepth]
    disk_free_bytes: int
    clock_offset_ns: int
    black_box: BlackBox
    def __init__(self, transport: _Optional[str] = ..., gateway: _Optional[str] = ..., budget_bytes_per_s: _Optional[int] = ..., sent_bytes_per_s: _Optional[float] = ..., reconnects: _Optional[int] = ..., classes: _Optional[_Iterable[_Union[ClassDepth, _Mapping]]] = ..., disk_free_bytes: _Optional[int] = ..., clock_offset_ns: _Optional[int] = ..., black_box: _Optional[_Union[BlackBox, _Mapping]] = ...) -> None: ...

class BlackBox(_message.Message):
    __slots__ = ("from_ns", "to_ns", "size_bytes", "quota_bytes", "lost")
    FROM_NS_FIELD_NUMBER: _ClassVar[int]
    TO_NS_FIELD_NUMBER: _ClassVar[int]
    SIZE_BYTES_FIELD_NUMBER: _ClassVar[int]
    QUOTA_BYTES_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    from_ns: int
    to_ns: int
    size_bytes: int
    quota_bytes: int
    lost: int
    def __init__(self, from_ns: _Optional[int] = ..., to_ns: _Optional[int] = ..., size_bytes: _Optional[int] = ..., quota_bytes: _Optional[int] = ..., lost: _Optional[int] = ...) -> None: ...

class ClassDepth(_message.Message):
    __slots__ = ("name", "fresh_bytes", "backfill_bytes", "samples", "lost", "disk_bytes", "quota_bytes")
    NAME_FIELD_NUMBER: _ClassVar[int]
    FRESH_BYTES_FIELD_NUMBER: _ClassVar[int]
    BACKFILL_BYTES_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    DISK_BYTES_FIELD_NUMBER: _ClassVar[int]
    QUOTA_BYTES_FIELD_NUMBER: _ClassVar[int]
    name: str
    fresh_bytes: int
    backfill_bytes: int
    samples: int
    lost: int
    disk_bytes: int
    quota_bytes: int
    def __init__(self, name: _Optional[str] = ..., fresh_bytes: _Optional[int] = ..., backfill_bytes: _Optional[int] = ..., samples: _Optional[int] = ..., lost: _Optional[int] = ..., disk_bytes: _Optional[int] = ..., quota_bytes: _Optional[int] = ...) -> None: ...

class TopicRate(_message.Message):
    __slots__ = ("channel_id", "rate_hz", "bytes_per_s", "messages", "dropped", "thinned", "publishers", "subscribers")
    CHANNEL_ID_FIELD_NUMBER: _ClassVar[int]
    RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    BYTES_PER_S_FIELD_NUMBER: _ClassVar[int]
    MESSAGES_FIELD_NUMBER: _ClassVar[int]
    DROPPED_FIELD_NUMBER: _ClassVar[int]
    THINNED_FIELD_NUMBER: _ClassVar[int]
    PUBLISHERS_FIELD_NUMBER: _ClassVar[int]
    SUBSCRIBERS_FIELD_NUMBER: _ClassVar[int]
    channel_id: int
    rate_hz: float
    bytes_per_s: float
    messages: int
    dropped: int
    thinned: int
    publishers: int
    subscribers: int
    def __init__(self, channel_id: _Optional[int] = ..., rate_hz: _Optional[float] = ..., bytes_per_s: _Optional[float] = ..., messages: _Optional[int] = ..., dropped: _Optional[int] = ..., thinned: _Optional[int] = ..., publishers: _Optional[int] = ..., subscribers: _Optional[int] = ...) -> None: ...

class Demand(_message.Message):
    __slots__ = ("revision", "entries")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    ENTRIES_FIELD_NUMBER: _ClassVar[int]
    revision: int
    entries: _containers.RepeatedCompositeFieldContainer[DemandEntry]
    def __init__(self, revision: _Optional[int] = ..., entries: _Optional[_Iterable[_Union[DemandEntry, _Mapping]]] = ...) -> None: ...

class DemandEntry(_message.Message):
    __slots__ = ("channel_id", "max_rate_hz", "viewers", "key_frames")
    CHANNEL_ID_FIELD_NUMBER: _ClassVar[int]
    MAX_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    VIEWERS_FIELD_NUMBER: _ClassVar[int]
    KEY_FRAMES_FIELD_NUMBER: _ClassVar[int]
    channel_id: int
    max_rate_hz: float
    viewers: int
    key_frames: int
    def __init__(self, channel_id: _Optional[int] = ..., max_rate_hz: _Optional[float] = ..., viewers: _Optional[int] = ..., key_frames: _Optional[int] = ...) -> None: ...

class Command(_message.Message):
    __slots__ = ("command_id", "timeout_ms", "lease_id", "publish", "call_service", "grant_lease", "release_lease", "set_uplink", "save_recording", "node_verb", "read_log", "send_goal", "cancel_goal", "grant_talk", "release_talk", "expires_ns", "durable", "sent_ns")
    COMMAND_ID_FIELD_NUMBER: _ClassVar[int]
    TIMEOUT_MS_FIELD_NUMBER: _ClassVar[int]
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_FIELD_NUMBER: _ClassVar[int]
    CALL_SERVICE_FIELD_NUMBER: _ClassVar[int]
    GRANT_LEASE_FIELD_NUMBER: _ClassVar[int]
    RELEASE_LEASE_FIELD_NUMBER: _ClassVar[int]
    SET_UPLINK_FIELD_NUMBER: _ClassVar[int]
    SAVE_RECORDING_FIELD_NUMBER: _ClassVar[int]
    NODE_VERB_FIELD_NUMBER: _ClassVar[int]
    READ_LOG_FIELD_NUMBER: _ClassVar[int]
    SEND_GOAL_FIELD_NUMBER: _ClassVar[int]
    CANCEL_GOAL_FIELD_NUMBER: _ClassVar[int]
    GRANT_TALK_FIELD_NUMBER: _ClassVar[int]
    RELEASE_TALK_FIELD_NUMBER: _ClassVar[int]
    EXPIRES_NS_FIELD_NUMBER: _ClassVar[int]
    DURABLE_FIELD_NUMBER: _ClassVar[int]
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    command_id: bytes
    timeout_ms: int
    lease_id: str
    publish: PublishMessage
    call_service: CallService
    grant_lease: GrantLease
    release_lease: ReleaseLease
    set_uplink: SetUplink
    save_recording: SaveRecording
    node_verb: NodeVerb
    read_log: ReadLog
    send_goal: SendGoal
    cancel_goal: CancelGoal
    grant_talk: GrantLease
    release_talk: ReleaseLease
    expires_ns: int
    durable: bool
    sent_ns: int
    def __init__(self, command_id: _Optional[bytes] = ..., timeout_ms: _Optional[int] = ..., lease_id: _Optional[str] = ..., publish: _Optional[_Union[PublishMessage, _Mapping]] = ..., call_service: _Optional[_Union[CallService, _Mapping]] = ..., grant_lease: _Optional[_Union[GrantLease, _Mapping]] = ..., release_lease: _Optional[_Union[ReleaseLease, _Mapping]] = ..., set_uplink: _Optional[_Union[SetUplink, _Mapping]] = ..., save_recording: _Optional[_Union[SaveRecording, _Mapping]] = ..., node_verb: _Optional[_Union[NodeVerb, _Mapping]] = ..., read_log: _Optional[_Union[ReadLog, _Mapping]] = ..., send_goal: _Optional[_Union[SendGoal, _Mapping]] = ..., cancel_goal: _Optional[_Union[CancelGoal, _Mapping]] = ..., grant_talk: _Optional[_Union[GrantLease, _Mapping]] = ..., release_talk: _Optional[_Union[ReleaseLease, _Mapping]] = ..., expires_ns: _Optional[int] = ..., durable: _Optional[bool] = ..., sent_ns: _Optional[int] = ...) -> None: ...

class NodeVerb(_message.Message):
    __slots__ = ("node", "verb", "signal")
    NODE_FIELD_NUMBER: _ClassVar[int]
    VERB_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    node: str
    verb: str
    signal: int
    def __init__(self, node: _Optional[str] = ..., verb: _Optional[str] = ..., signal: _Optional[int] = ...) -> None: ...

class ReadLog(_message.Message):
    __slots__ = ("node", "cursor", "max_bytes", "query", "backwards")
    NODE_FIELD_NUMBER: _ClassVar[int]
    CURSOR_FIELD_NUMBER: _ClassVar[int]
    MAX_BYTES_FIELD_NUMBER: _ClassVar[int]
    QUERY_FIELD_NUMBER: _ClassVar[int]
    BACKWARDS_FIELD_NUMBER: _ClassVar[int]
    node: str
    cursor: str
    max_bytes: int
    query: str
    backwards: bool
    def __init__(self, node: _Optional[str] = ..., cursor: _Optional[str] = ..., max_bytes: _Optional[int] = ..., query: _Optional[str] = ..., backwards: _Optional[bool] = ...) -> None: ...

class PublishMessage(_message.Message):
    __slots__ = ("topic", "type_name", "type_hash", "payload")
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_HASH_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_FIELD_NUMBER: _ClassVar[int]
    topic: str
    type_name: str
    type_hash: str
    payload: bytes
    def __init__(self, topic: _Optional[str] = ..., type_name: _Optional[str] = ..., type_hash: _Optional[str] = ..., payload: _Optional[bytes] = ...) -> None: ...

class CallService(_message.Message):
    __slots__ = ("service", "type_name", "type_hash", "request")
    SERVICE_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_HASH_FIELD_NUMBER: _ClassVar[int]
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    service: str
    type_name: str
    type_hash: str
    request: bytes
    def __init__(self, service: _Optional[str] = ..., type_name: _Optional[str] = ..., type_hash: _Optional[str] = ..., request: _Optional[bytes] = ...) -> None: ...

class SendGoal(_message.Message):
    __slots__ = ("action", "type_name", "goal_id", "goal", "type_hash")
    ACTION_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    GOAL_ID_FIELD_NUMBER: _ClassVar[int]
    GOAL_FIELD_NUMBER: _ClassVar[int]
    TYPE_HASH_FIELD_NUMBER: _ClassVar[int]
    action: str
    type_name: str
    goal_id: bytes
    goal: bytes
    type_hash: str
    def __init__(self, action: _Optional[str] = ..., type_name: _Optional[str] = ..., goal_id: _Optional[bytes] = ..., goal: _Optional[bytes] = ..., type_hash: _Optional[str] = ...) -> None: ...

class CancelGoal(_message.Message):
    __slots__ = ("goal_id",)
    GOAL_ID_FIELD_NUMBER: _ClassVar[int]
    goal_id: bytes
    def __init__(self, goal_id: _Optional[bytes] = ...) -> None: ...

class GrantLease(_message.Message):
    __slots__ = ("lease_id", "holder", "valid_ms")
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    HOLDER_FIELD_NUMBER: _ClassVar[int]
    VALID_MS_FIELD_NUMBER: _ClassVar[int]
    lease_id: str
    holder: str
    valid_ms: int
    def __init__(self, lease_id: _Optional[str] = ..., holder: _Optional[str] = ..., valid_ms: _Optional[int] = ...) -> None: ...

class ReleaseLease(_message.Message):
    __slots__ = ("lease_id",)
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    lease_id: str
    def __init__(self, lease_id: _Optional[str] = ...) -> None: ...

class SetUplink(_message.Message):
    __slots__ = ("bytes_per_s",)
    BYTES_PER_S_FIELD_NUMBER: _ClassVar[int]
    bytes_per_s: int
    def __init__(self, bytes_per_s: _Optional[int] = ...) -> None: ...

class SaveRecording(_message.Message):
    __slots__ = ("recording_id", "from_ns", "to_ns", "topics", "last_ns")
    RECORDING_ID_FIELD_NUMBER: _ClassVar[int]
    FROM_NS_FIELD_NUMBER: _ClassVar[int]
    TO_NS_FIELD_NUMBER: _ClassVar[int]
    TOPICS_FIELD_NUMBER: _ClassVar[int]
    LAST_NS_FIELD_NUMBER: _ClassVar[int]
    recording_id: str
    from_ns: int
    to_ns: int
    topics: _containers.RepeatedScalarFieldContainer[str]
    last_ns: int
    def __init__(self, recording_id: _Optional[str] = ..., from_ns: _Optional[int] = ..., to_ns: _Optional[int] = ..., topics: _Optional[_Iterable[str]] = ..., last_ns: _Optional[int] = ...) -> None: ...

class CommandResult(_message.Message):
    __slots__ = ("command_id", "ok", "code", "message", "payload", "running", "kept")
    COMMAND_ID_FIELD_NUMBER: _ClassVar[int]
    OK_FIELD_NUMBER: _ClassVar[int]
    CODE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_FIELD_NUMBER: _ClassVar[int]
    RUNNING_FIELD_NUMBER: _ClassVar[int]
    KEPT_FIELD_NUMBER: _ClassVar[int]
    command_id: bytes
    ok: bool
    code: str
    message: str
    payload: bytes
    running: bool
    kept: bool
    def __init__(self, command_id: _Optional[bytes] = ..., ok: _Optional[bool] = ..., code: _Optional[str] = ..., message: _Optional[str] = ..., payload: _Optional[bytes] = ..., running: _Optional[bool] = ..., kept: _Optional[bool] = ...) -> None: ...

class ResultStored(_message.Message):
    __slots__ = ("command_id",)
    COMMAND_ID_FIELD_NUMBER: _ClassVar[int]
    command_id: bytes
    def __init__(self, command_id: _Optional[bytes] = ...) -> None: ...

class TwinDesired(_message.Message):
    __slots__ = ("revision", "sha256", "document", "confirm_within_ms")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    SHA256_FIELD_NUMBER: _ClassVar[int]
    DOCUMENT_FIELD_NUMBER: _ClassVar[int]
    CONFIRM_WITHIN_MS_FIELD_NUMBER: _ClassVar[int]
    revision: int
    sha256: bytes
    document: bytes
    confirm_within_ms: int
    def __init__(self, revision: _Optional[int] = ..., sha256: _Optional[bytes] = ..., document: _Optional[bytes] = ..., confirm_within_ms: _Optional[int] = ...) -> None: ...

class TwinConfirmed(_message.Message):
    __slots__ = ("revision",)
    REVISION_FIELD_NUMBER: _ClassVar[int]
    revision: int
    def __init__(self, revision: _Optional[int] = ...) -> None: ...

class TwinReport(_message.Message):
    __slots__ = ("revision", "applied", "state", "code", "message", "sha256", "reported")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    APPLIED_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    CODE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    SHA256_FIELD_NUMBER: _ClassVar[int]
    REPORTED_FIELD_NUMBER: _ClassVar[int]
    revision: int
    applied: int
    state: str
    code: str
    message: str
    sha256: bytes
    reported: bytes
    def __init__(self, revision: _Optional[int] = ..., applied: _Optional[int] = ..., state: _Optional[str] = ..., code: _Optional[str] = ..., message: _Optional[str] = ..., sha256: _Optional[bytes] = ..., reported: _Optional[bytes] = ...) -> None: ...

class NodeLeases(_message.Message):
    __slots__ = ("leases", "since_ns")
    LEASES_FIELD_NUMBER: _ClassVar[int]
    SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    leases: _containers.RepeatedCompositeFieldContainer[NodeLease]
    since_ns: int
    def __init__(self, leases: _Optional[_Iterable[_Union[NodeLease, _Mapping]]] = ..., since_ns: _Optional[int] = ...) -> None: ...

class NodeLease(_message.Message):
    __slots__ = ("node", "lease_id", "valid_ms", "epoch")
    NODE_FIELD_NUMBER: _ClassVar[int]
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    VALID_MS_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    node: str
    lease_id: str
    valid_ms: int
    epoch: int
    def __init__(self, node: _Optional[str] = ..., lease_id: _Optional[str] = ..., valid_ms: _Optional[int] = ..., epoch: _Optional[int] = ...) -> None: ...

class LeasesTaken(_message.Message):
    __slots__ = ("boot_ns",)
    BOOT_NS_FIELD_NUMBER: _ClassVar[int]
    boot_ns: int
    def __init__(self, boot_ns: _Optional[int] = ...) -> None: ...

class Teleop(_message.Message):
    __slots__ = ("lease_id", "seq", "sent_ns", "topic", "type_name", "type_hash", "payload")
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_HASH_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_FIELD_NUMBER: _ClassVar[int]
    lease_id: str
    seq: int
    sent_ns: int
    topic: str
    type_name: str
    type_hash: str
    payload: bytes
    def __init__(self, lease_id: _Optional[str] = ..., seq: _Optional[int] = ..., sent_ns: _Optional[int] = ..., topic: _Optional[str] = ..., type_name: _Optional[str] = ..., type_hash: _Optional[str] = ..., payload: _Optional[bytes] = ...) -> None: ...

class Heartbeat(_message.Message):
    __slots__ = ("sent_ns", "echo_ns", "held_ns")
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    ECHO_NS_FIELD_NUMBER: _ClassVar[int]
    HELD_NS_FIELD_NUMBER: _ClassVar[int]
    sent_ns: int
    echo_ns: int
    held_ns: int
    def __init__(self, sent_ns: _Optional[int] = ..., echo_ns: _Optional[int] = ..., held_ns: _Optional[int] = ...) -> None: ...

class RecordingPart(_message.Message):
    __slots__ = ("recording_id", "offset", "data", "size_bytes", "sha256", "from_ns", "to_ns", "messages", "failed")
    RECORDING_ID_FIELD_NUMBER: _ClassVar[int]
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    DATA_FIELD_NUMBER: _ClassVar[int]
    SIZE_BYTES_FIELD_NUMBER: _ClassVar[int]
    SHA256_FIELD_NUMBER: _ClassVar[int]
    FROM_NS_FIELD_NUMBER: _ClassVar[int]
    TO_NS_FIELD_NUMBER: _ClassVar[int]
    MESSAGES_FIELD_NUMBER: _ClassVar[int]
    FAILED_FIELD_NUMBER: _ClassVar[int]
    recording_id: str
    offset: int
    data: bytes
    size_bytes: int
    sha256: bytes
    from_ns: int
    to_ns: int
    messages: int
    failed: str
    def __init__(self, recording_id: _Optional[str] = ..., offset: _Optional[int] = ..., data: _Optional[bytes] = ..., size_bytes: _Optional[int] = ..., sha256: _Optional[bytes] = ..., from_ns: _Optional[int] = ..., to_ns: _Optional[int] = ..., messages: _Optional[int] = ..., failed: _Optional[str] = ...) -> None: ...

class RecordingWanted(_message.Message):
    __slots__ = ("recording_id", "offset", "stored", "unwanted")
    RECORDING_ID_FIELD_NUMBER: _ClassVar[int]
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    STORED_FIELD_NUMBER: _ClassVar[int]
    UNWANTED_FIELD_NUMBER: _ClassVar[int]
    recording_id: str
    offset: int
    stored: bool
    unwanted: bool
    def __init__(self, recording_id: _Optional[str] = ..., offset: _Optional[int] = ..., stored: _Optional[bool] = ..., unwanted: _Optional[bool] = ...) -> None: ...

class RetryLater(_message.Message):
    __slots__ = ("token", "retry_after_ms", "reason")
    TOKEN_FIELD_NUMBER: _ClassVar[int]
    RETRY_AFTER_MS_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    token: int
    retry_after_ms: int
    reason: str
    def __init__(self, token: _Optional[int] = ..., retry_after_ms: _Optional[int] = ..., reason: _Optional[str] = ...) -> None: ...

class Resumed(_message.Message):
    __slots__ = ("token",)
    TOKEN_FIELD_NUMBER: _ClassVar[int]
    token: int
    def __init__(self, token: _Optional[int] = ...) -> None: ...

class Goodbye(_message.Message):
    __slots__ = ("code", "message", "retry_after_ms")
    CODE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    RETRY_AFTER_MS_FIELD_NUMBER: _ClassVar[int]
    code: str
    message: str
    retry_after_ms: int
    def __init__(self, code: _Optional[str] = ..., message: _Optional[str] = ..., retry_after_ms: _Optional[int] = ...) -> None: ...

class GraphReport(_message.Message):
    __slots__ = ("revision", "anew", "more", "nodes", "nodes_gone", "endpoints", "endpoints_gone", "types", "left_out")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    ANEW_FIELD_NUMBER: _ClassVar[int]
    MORE_FIELD_NUMBER: _ClassVar[int]
    NODES_FIELD_NUMBER: _ClassVar[int]
    NODES_GONE_FIELD_NUMBER: _ClassVar[int]
    ENDPOINTS_FIELD_NUMBER: _ClassVar[int]
    ENDPOINTS_GONE_FIELD_NUMBER: _ClassVar[int]
    TYPES_FIELD_NUMBER: _ClassVar[int]
    LEFT_OUT_FIELD_NUMBER: _ClassVar[int]
    revision: int
    anew: bool
    more: bool
    nodes: _containers.RepeatedScalarFieldContainer[str]
    nodes_gone: _containers.RepeatedScalarFieldContainer[str]
    endpoints: _containers.RepeatedCompositeFieldContainer[GraphEndpoint]
    endpoints_gone: _containers.RepeatedScalarFieldContainer[int]
    types: _containers.RepeatedCompositeFieldContainer[TypeText]
    left_out: int
    def __init__(self, revision: _Optional[int] = ..., anew: _Optional[bool] = ..., more: _Optional[bool] = ..., nodes: _Optional[_Iterable[str]] = ..., nodes_gone: _Optional[_Iterable[str]] = ..., endpoints: _Optional[_Iterable[_Union[GraphEndpoint, _Mapping]]] = ..., endpoints_gone: _Optional[_Iterable[int]] = ..., types: _Optional[_Iterable[_Union[TypeText, _Mapping]]] = ..., left_out: _Optional[int] = ...) -> None: ...

class GraphEndpoint(_message.Message):
    __slots__ = ("number", "kind", "node", "name", "type_name", "type_hash", "qos")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    NODE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_HASH_FIELD_NUMBER: _ClassVar[int]
    QOS_FIELD_NUMBER: _ClassVar[int]
    number: int
    kind: EndpointKind
    node: str
    name: str
    type_name: str
    type_hash: str
    qos: str
    def __init__(self, number: _Optional[int] = ..., kind: _Optional[_Union[EndpointKind, str]] = ..., node: _Optional[str] = ..., name: _Optional[str] = ..., type_name: _Optional[str] = ..., type_hash: _Optional[str] = ..., qos: _Optional[str] = ...) -> None: ...

class TypeText(_message.Message):
    __slots__ = ("type_name", "type_hash", "parts")
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_HASH_FIELD_NUMBER: _ClassVar[int]
    PARTS_FIELD_NUMBER: _ClassVar[int]
    type_name: str
    type_hash: str
    parts: _containers.RepeatedCompositeFieldContainer[TypePart]
    def __init__(self, type_name: _Optional[str] = ..., type_hash: _Optional[str] = ..., parts: _Optional[_Iterable[_Union[TypePart, _Mapping]]] = ...) -> None: ...

class TypePart(_message.Message):
    __slots__ = ("name", "text")
    NAME_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    name: str
    text: str
    def __init__(self, name: _Optional[str] = ..., text: _Optional[str] = ...) -> None: ...

class GoalEvents(_message.Message):
    __slots__ = ("events", "all_told", "goal_ids")
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    ALL_TOLD_FIELD_NUMBER: _ClassVar[int]
    GOAL_IDS_FIELD_NUMBER: _ClassVar[int]
    events: _containers.RepeatedCompositeFieldContainer[GoalEvent]
    all_told: bool
    goal_ids: _containers.RepeatedScalarFieldContainer[bytes]
    def __init__(self, events: _Optional[_Iterable[_Union[GoalEvent, _Mapping]]] = ..., all_told: _Optional[bool] = ..., goal_ids: _Optional[_Iterable[bytes]] = ...) -> None: ...

class GoalEvent(_message.Message):
    __slots__ = ("goal_id", "action", "type_name", "status", "ended", "feedback", "result", "code", "message", "stamp_ns", "skipped", "type_hash")
    GOAL_ID_FIELD_NUMBER: _ClassVar[int]
    ACTION_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    ENDED_FIELD_NUMBER: _ClassVar[int]
    FEEDBACK_FIELD_NUMBER: _ClassVar[int]
    RESULT_FIELD_NUMBER: _ClassVar[int]
    CODE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    STAMP_NS_FIELD_NUMBER: _ClassVar[int]
    SKIPPED_FIELD_NUMBER: _ClassVar[int]
    TYPE_HASH_FIELD_NUMBER: _ClassVar[int]
    goal_id: bytes
    action: str
    type_name: str
    status: int
    ended: bool
    feedback: bytes
    result: bytes
    code: str
    message: str
    stamp_ns: int
    skipped: int
    type_hash: str
    def __init__(self, goal_id: _Optional[bytes] = ..., action: _Optional[str] = ..., type_name: _Optional[str] = ..., status: _Optional[int] = ..., ended: _Optional[bool] = ..., feedback: _Optional[bytes] = ..., result: _Optional[bytes] = ..., code: _Optional[str] = ..., message: _Optional[str] = ..., stamp_ns: _Optional[int] = ..., skipped: _Optional[int] = ..., type_hash: _Optional[str] = ...) -> None: ...

class Offers(_message.Message):
    __slots__ = ("revision", "offers")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    OFFERS_FIELD_NUMBER: _ClassVar[int]
    revision: int
    offers: _containers.RepeatedCompositeFieldContainer[Offer]
    def __init__(self, revision: _Optional[int] = ..., offers: _Optional[_Iterable[_Union[Offer, _Mapping]]] = ...) -> None: ...

class Offer(_message.Message):
    __slots__ = ("number", "action", "name", "type_name", "type_hash", "type")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    ACTION_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_HASH_FIELD_NUMBER: _ClassVar[int]
    TYPE_FIELD_NUMBER: _ClassVar[int]
    number: int
    action: bool
    name: str
    type_name: str
    type_hash: str
    type: TypeText
    def __init__(self, number: _Optional[int] = ..., action: _Optional[bool] = ..., name: _Optional[str] = ..., type_name: _Optional[str] = ..., type_hash: _Optional[str] = ..., type: _Optional[_Union[TypeText, _Mapping]] = ...) -> None: ...

class OfferStates(_message.Message):
    __slots__ = ("states",)
    STATES_FIELD_NUMBER: _ClassVar[int]
    states: _containers.RepeatedCompositeFieldContainer[OfferState]
    def __init__(self, states: _Optional[_Iterable[_Union[OfferState, _Mapping]]] = ...) -> None: ...

class OfferState(_message.Message):
    __slots__ = ("number", "code", "message")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    CODE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    number: int
    code: str
    message: str
    def __init__(self, number: _Optional[int] = ..., code: _Optional[str] = ..., message: _Optional[str] = ...) -> None: ...

class OfferAsked(_message.Message):
    __slots__ = ("number", "ask", "request", "goal_id", "cancel", "gone")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    ASK_FIELD_NUMBER: _ClassVar[int]
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    GOAL_ID_FIELD_NUMBER: _ClassVar[int]
    CANCEL_FIELD_NUMBER: _ClassVar[int]
    GONE_FIELD_NUMBER: _ClassVar[int]
    number: int
    ask: int
    request: bytes
    goal_id: bytes
    cancel: bool
    gone: bool
    def __init__(self, number: _Optional[int] = ..., ask: _Optional[int] = ..., request: _Optional[bytes] = ..., goal_id: _Optional[bytes] = ..., cancel: _Optional[bool] = ..., gone: _Optional[bool] = ...) -> None: ...

class OfferAnswer(_message.Message):
    __slots__ = ("ask", "ended", "ok", "payload", "message", "status")
    ASK_FIELD_NUMBER: _ClassVar[int]
    ENDED_FIELD_NUMBER: _ClassVar[int]
    OK_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    ask: int
    ended: bool
    ok: bool
    payload: bytes
    message: str
    status: int
    def __init__(self, ask: _Optional[int] = ..., ended: _Optional[bool] = ..., ok: _Optional[bool] = ..., payload: _Optional[bytes] = ..., message: _Optional[str] = ..., status: _Optional[int] = ...) -> None: ...
