from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ListAlertsRequest(_message.Message):
    __slots__ = ("filter", "before", "limit")
    FILTER_FIELD_NUMBER: _ClassVar[int]
    BEFORE_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    filter: AlertFilter
    before: str
    limit: int
    def __init__(self, filter: _Optional[_Union[AlertFilter, _Mapping]] = ..., before: _Optional[str] = ..., limit: _Optional[int] = ...) -> None: ...

class ListAlertsResponse(_message.Message):
    __slots__ = ("alerts", "next")
    ALERTS_FIELD_NUMBER: _ClassVar[int]
    NEXT_FIELD_NUMBER: _ClassVar[int]
    alerts: _containers.RepeatedCompositeFieldContainer[Alert]
    next: str
    def __init__(self, alerts: _Optional[_Iterable[_Union[Alert, _Mapping]]] = ..., next: _Optional[str] = ...) -> None: ...

class AlertFilter(_message.Message):
    __slots__ = ("states", "severities", "robots", "causes", "text", "from_ns", "until_ns", "quiet")
    STATES_FIELD_NUMBER: _ClassVar[int]
    SEVERITIES_FIELD_NUMBER: _ClassVar[int]
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    CAUSES_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    FROM_NS_FIELD_NUMBER: _ClassVar[int]
    UNTIL_NS_FIELD_NUMBER: _ClassVar[int]
    QUIET_FIELD_NUMBER: _ClassVar[int]
    states: _containers.RepeatedScalarFieldContainer[str]
    severities: _containers.RepeatedScalarFieldContainer[str]
    robots: _containers.RepeatedScalarFieldContainer[str]
    causes: _containers.RepeatedScalarFieldContainer[str]
    text: str
    from_ns: int
    until_ns: int
    quiet: bool
    def __init__(self, states: _Optional[_Iterable[str]] = ..., severities: _Optional[_Iterable[str]] = ..., robots: _Optional[_Iterable[str]] = ..., causes: _Optional[_Iterable[str]] = ..., text: _Optional[str] = ..., from_ns: _Optional[int] = ..., until_ns: _Optional[int] = ..., quiet: _Optional[bool] = ...) -> None: ...

class CountAlertsRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class AlertCounts(_message.Message):
    __slots__ = ("open", "acknowledged", "error", "warning", "info", "quiet")
    OPEN_FIELD_NUMBER: _ClassVar[int]
    ACKNOWLEDGED_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    WARNING_FIELD_NUMBER: _ClassVar[int]
    INFO_FIELD_NUMBER: _ClassVar[int]
    QUIET_FIELD_NUMBER: _ClassVar[int]
    open: int
    acknowledged: int
    error: int
    warning: int
    info: int
    quiet: int
    def __init__(self, open: _Optional[int] = ..., acknowledged: _Optional[int] = ..., error: _Optional[int] = ..., warning: _Optional[int] = ..., info: _Optional[int] = ..., quiet: _Optional[int] = ...) -> None: ...

class GetAlertRequest(_message.Message):
    __slots__ = ("alert",)
    ALERT_FIELD_NUMBER: _ClassVar[int]
    alert: str
    def __init__(self, alert: _Optional[str] = ...) -> None: ...

class Alert(_message.Message):
    __slots__ = ("id", "robot", "cause", "state", "severity", "title", "reason", "series", "detector", "score", "value", "low", "high", "opened_ns", "first_ns", "changed_ns", "seen_ns", "resolved_ns", "resolved_by", "acknowledged_ns", "acknowledged_by", "assignee", "times", "clip", "inhibited_by", "silence", "gateway", "revision", "path")
    ID_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    SEVERITY_FIELD_NUMBER: _ClassVar[int]
    TITLE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    SERIES_FIELD_NUMBER: _ClassVar[int]
    DETECTOR_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    LOW_FIELD_NUMBER: _ClassVar[int]
    HIGH_FIELD_NUMBER: _ClassVar[int]
    OPENED_NS_FIELD_NUMBER: _ClassVar[int]
    FIRST_NS_FIELD_NUMBER: _ClassVar[int]
    CHANGED_NS_FIELD_NUMBER: _ClassVar[int]
    SEEN_NS_FIELD_NUMBER: _ClassVar[int]
    RESOLVED_NS_FIELD_NUMBER: _ClassVar[int]
    RESOLVED_BY_FIELD_NUMBER: _ClassVar[int]
    ACKNOWLEDGED_NS_FIELD_NUMBER: _ClassVar[int]
    ACKNOWLEDGED_BY_FIELD_NUMBER: _ClassVar[int]
    ASSIGNEE_FIELD_NUMBER: _ClassVar[int]
    TIMES_FIELD_NUMBER: _ClassVar[int]
    CLIP_FIELD_NUMBER: _ClassVar[int]
    INHIBITED_BY_FIELD_NUMBER: _ClassVar[int]
    SILENCE_FIELD_NUMBER: _ClassVar[int]
    GATEWAY_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    id: str
    robot: str
    cause: str
    state: str
    severity: str
    title: str
    reason: str
    series: str
    detector: str
    score: float
    value: float
    low: float
    high: float
    opened_ns: int
    first_ns: int
    changed_ns: int
    seen_ns: int
    resolved_ns: int
    resolved_by: str
    acknowledged_ns: int
    acknowledged_by: str
    assignee: str
    times: int
    clip: str
    inhibited_by: str
    silence: str
    gateway: str
    revision: int
    path: str
    def __init__(self, id: _Optional[str] = ..., robot: _Optional[str] = ..., cause: _Optional[str] = ..., state: _Optional[str] = ..., severity: _Optional[str] = ..., title: _Optional[str] = ..., reason: _Optional[str] = ..., series: _Optional[str] = ..., detector: _Optional[str] = ..., score: _Optional[float] = ..., value: _Optional[float] = ..., low: _Optional[float] = ..., high: _Optional[float] = ..., opened_ns: _Optional[int] = ..., first_ns: _Optional[int] = ..., changed_ns: _Optional[int] = ..., seen_ns: _Optional[int] = ..., resolved_ns: _Optional[int] = ..., resolved_by: _Optional[str] = ..., acknowledged_ns: _Optional[int] = ..., acknowledged_by: _Optional[str] = ..., assignee: _Optional[str] = ..., times: _Optional[int] = ..., clip: _Optional[str] = ..., inhibited_by: _Optional[str] = ..., silence: _Optional[str] = ..., gateway: _Optional[str] = ..., revision: _Optional[int] = ..., path: _Optional[str] = ...) -> None: ...

class AlertDetail(_message.Message):
    __slots__ = ("alert", "findings", "remarks")
    ALERT_FIELD_NUMBER: _ClassVar[int]
    FINDINGS_FIELD_NUMBER: _ClassVar[int]
    REMARKS_FIELD_NUMBER: _ClassVar[int]
    alert: Alert
    findings: _containers.RepeatedCompositeFieldContainer[AlertFinding]
    remarks: _containers.RepeatedCompositeFieldContainer[AlertRemark]
    def __init__(self, alert: _Optional[_Union[Alert, _Mapping]] = ..., findings: _Optional[_Iterable[_Union[AlertFinding, _Mapping]]] = ..., remarks: _Optional[_Iterable[_Union[AlertRemark, _Mapping]]] = ...) -> None: ...

class AlertFinding(_message.Message):
    __slots__ = ("detector", "series", "severity", "score", "value", "low", "high", "reason", "at_ns", "active", "cause", "until_ns")
    DETECTOR_FIELD_NUMBER: _ClassVar[int]
    SERIES_FIELD_NUMBER: _ClassVar[int]
    SEVERITY_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    LOW_FIELD_NUMBER: _ClassVar[int]
    HIGH_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    AT_NS_FIELD_NUMBER: _ClassVar[int]
    ACTIVE_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    UNTIL_NS_FIELD_NUMBER: _ClassVar[int]
    detector: str
    series: str
    severity: str
    score: float
    value: float
    low: float
    high: float
    reason: str
    at_ns: int
    active: bool
    cause: str
    until_ns: int
    def __init__(self, detector: _Optional[str] = ..., series: _Optional[str] = ..., severity: _Optional[str] = ..., score: _Optional[float] = ..., value: _Optional[float] = ..., low: _Optional[float] = ..., high: _Optional[float] = ..., reason: _Optional[str] = ..., at_ns: _Optional[int] = ..., active: _Optional[bool] = ..., cause: _Optional[str] = ..., until_ns: _Optional[int] = ...) -> None: ...

class AlertRemark(_message.Message):
    __slots__ = ("number", "at_ns", "by", "kind", "text")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    AT_NS_FIELD_NUMBER: _ClassVar[int]
    BY_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    number: int
    at_ns: int
    by: str
    kind: str
    text: str
    def __init__(self, number: _Optional[int] = ..., at_ns: _Optional[int] = ..., by: _Optional[str] = ..., kind: _Optional[str] = ..., text: _Optional[str] = ...) -> None: ...

class WatchAlertsRequest(_message.Message):
    __slots__ = ("filter",)
    FILTER_FIELD_NUMBER: _ClassVar[int]
    filter: AlertFilter
    def __init__(self, filter: _Optional[_Union[AlertFilter, _Mapping]] = ...) -> None: ...

class WatchAlertsReply(_message.Message):
    __slots__ = ("change", "alert")
    CHANGE_FIELD_NUMBER: _ClassVar[int]
    ALERT_FIELD_NUMBER: _ClassVar[int]
    change: str
    alert: Alert
    def __init__(self, change: _Optional[str] = ..., alert: _Optional[_Union[Alert, _Mapping]] = ...) -> None: ...

class AlertActionRequest(_message.Message):
    __slots__ = ("alert", "text")
    ALERT_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    alert: str
    text: str
    def __init__(self, alert: _Optional[str] = ..., text: _Optional[str] = ...) -> None: ...

class AssignAlertRequest(_message.Message):
    __slots__ = ("alert", "assignee")
    ALERT_FIELD_NUMBER: _ClassVar[int]
    ASSIGNEE_FIELD_NUMBER: _ClassVar[int]
    alert: str
    assignee: str
    def __init__(self, alert: _Optional[str] = ..., assignee: _Optional[str] = ...) -> None: ...

class AcceptAlertResponse(_message.Message):
    __slots__ = ("alert", "taught")
    ALERT_FIELD_NUMBER: _ClassVar[int]
    TAUGHT_FIELD_NUMBER: _ClassVar[int]
    alert: Alert
    taught: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, alert: _Optional[_Union[Alert, _Mapping]] = ..., taught: _Optional[_Iterable[str]] = ...) -> None: ...

class SilenceAlertRequest(_message.Message):
    __slots__ = ("alert", "for_s", "reason")
    ALERT_FIELD_NUMBER: _ClassVar[int]
    FOR_S_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    alert: str
    for_s: float
    reason: str
    def __init__(self, alert: _Optional[str] = ..., for_s: _Optional[float] = ..., reason: _Optional[str] = ...) -> None: ...

class ClipAlertResponse(_message.Message):
    __slots__ = ("recording",)
    RECORDING_FIELD_NUMBER: _ClassVar[int]
    recording: str
    def __init__(self, recording: _Optional[str] = ...) -> None: ...

class ListSilencesRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ListSilencesResponse(_message.Message):
    __slots__ = ("silences",)
    SILENCES_FIELD_NUMBER: _ClassVar[int]
    silences: _containers.RepeatedCompositeFieldContainer[AlertSilence]
    def __init__(self, silences: _Optional[_Iterable[_Union[AlertSilence, _Mapping]]] = ...) -> None: ...

class AlertSilence(_message.Message):
    __slots__ = ("id", "robots", "causes", "up_to", "from_ns", "until_ns", "by", "reason")
    ID_FIELD_NUMBER: _ClassVar[int]
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    CAUSES_FIELD_NUMBER: _ClassVar[int]
    UP_TO_FIELD_NUMBER: _ClassVar[int]
    FROM_NS_FIELD_NUMBER: _ClassVar[int]
    UNTIL_NS_FIELD_NUMBER: _ClassVar[int]
    BY_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    id: str
    robots: _containers.RepeatedScalarFieldContainer[str]
    causes: _containers.RepeatedScalarFieldContainer[str]
    up_to: str
    from_ns: int
    until_ns: int
    by: str
    reason: str
    def __init__(self, id: _Optional[str] = ..., robots: _Optional[_Iterable[str]] = ..., causes: _Optional[_Iterable[str]] = ..., up_to: _Optional[str] = ..., from_ns: _Optional[int] = ..., until_ns: _Optional[int] = ..., by: _Optional[str] = ..., reason: _Optional[str] = ...) -> None: ...

class AddSilenceRequest(_message.Message):
    __slots__ = ("robots", "causes", "up_to", "for_s", "reason")
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    CAUSES_FIELD_NUMBER: _ClassVar[int]
    UP_TO_FIELD_NUMBER: _ClassVar[int]
    FOR_S_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    robots: _containers.RepeatedScalarFieldContainer[str]
    causes: _containers.RepeatedScalarFieldContainer[str]
    up_to: str
    for_s: float
    reason: str
    def __init__(self, robots: _Optional[_Iterable[str]] = ..., causes: _Optional[_Iterable[str]] = ..., up_to: _Optional[str] = ..., for_s: _Optional[float] = ..., reason: _Optional[str] = ...) -> None: ...

class EndSilenceRequest(_message.Message):
    __slots__ = ("silence",)
    SILENCE_FIELD_NUMBER: _ClassVar[int]
    silence: str
    def __init__(self, silence: _Optional[str] = ...) -> None: ...

class ListChecksRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ListChecksResponse(_message.Message):
    __slots__ = ("checks",)
    CHECKS_FIELD_NUMBER: _ClassVar[int]
    checks: _containers.RepeatedCompositeFieldContainer[AlertCheck]
    def __init__(self, checks: _Optional[_Iterable[_Union[AlertCheck, _Mapping]]] = ...) -> None: ...

class AlertCheck(_message.Message):
    __slots__ = ("id", "title", "unit", "severity", "enabled", "low", "high", "for_s", "clear_s", "changed", "by", "at_ns")
    ID_FIELD_NUMBER: _ClassVar[int]
    TITLE_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    SEVERITY_FIELD_NUMBER: _ClassVar[int]
    ENABLED_FIELD_NUMBER: _ClassVar[int]
    LOW_FIELD_NUMBER: _ClassVar[int]
    HIGH_FIELD_NUMBER: _ClassVar[int]
    FOR_S_FIELD_NUMBER: _ClassVar[int]
    CLEAR_S_FIELD_NUMBER: _ClassVar[int]
    CHANGED_FIELD_NUMBER: _ClassVar[int]
    BY_FIELD_NUMBER: _ClassVar[int]
    AT_NS_FIELD_NUMBER: _ClassVar[int]
    id: str
    title: str
    unit: str
    severity: str
    enabled: bool
    low: float
    high: float
    for_s: float
    clear_s: float
    changed: _containers.RepeatedScalarFieldContainer[str]
    by: str
    at_ns: int
    def __init__(self, id: _Optional[str] = ..., title: _Optional[str] = ..., unit: _Optional[str] = ..., severity: _Optional[str] = ..., enabled: _Optional[bool] = ..., low: _Optional[float] = ..., high: _Optional[float] = ..., for_s: _Optional[float] = ..., clear_s: _Optional[float] = ..., changed: _Optional[_Iterable[str]] = ..., by: _Optional[str] = ..., at_ns: _Optional[int] = ...) -> None: ...

class SetCheckRequest(_message.Message):
    __slots__ = ("check", "enabled", "low", "high", "for_s", "clear_s", "severity")
    CHECK_FIELD_NUMBER: _ClassVar[int]
    ENABLED_FIELD_NUMBER: _ClassVar[int]
    LOW_FIELD_NUMBER: _ClassVar[int]
    HIGH_FIELD_NUMBER: _ClassVar[int]
    FOR_S_FIELD_NUMBER: _ClassVar[int]
    CLEAR_S_FIELD_NUMBER: _ClassVar[int]
    SEVERITY_FIELD_NUMBER: _ClassVar[int]
    check: str
    enabled: bool
    low: float
    high: float
    for_s: float
    clear_s: float
    severity: str
    def __init__(self, check: _Optional[str] = ..., enabled: _Optional[bool] = ..., low: _Optional[float] = ..., high: _Optional[float] = ..., for_s: _Optional[float] = ..., clear_s: _Optional[float] = ..., severity: _Optional[str] = ...) -> None: ...

class ResetCheckRequest(_message.Message):
    __slots__ = ("check",)
    CHECK_FIELD_NUMBER: _ClassVar[int]
    check: str
    def __init__(self, check: _Optional[str] = ...) -> None: ...

class ListRoutesRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ListRoutesResponse(_message.Message):
    __slots__ = ("routes",)
    ROUTES_FIELD_NUMBER: _ClassVar[int]
    routes: _containers.RepeatedCompositeFieldContainer[AlertRoute]
    def __init__(self, routes: _Optional[_Iterable[_Union[AlertRoute, _Mapping]]] = ...) -> None: ...

class AlertRoute(_message.Message):
    __slots__ = ("name", "kind", "target", "severity", "robots", "causes", "sent", "failed", "waiting", "last_ns", "last_error")
    NAME_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    TARGET_FIELD_NUMBER: _ClassVar[int]
    SEVERITY_FIELD_NUMBER: _ClassVar[int]
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    CAUSES_FIELD_NUMBER: _ClassVar[int]
    SENT_FIELD_NUMBER: _ClassVar[int]
    FAILED_FIELD_NUMBER: _ClassVar[int]
    WAITING_FIELD_NUMBER: _ClassVar[int]
    LAST_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_ERROR_FIELD_NUMBER: _ClassVar[int]
    name: str
    kind: str
    target: str
    severity: str
    robots: _containers.RepeatedScalarFieldContainer[str]
    causes: _containers.RepeatedScalarFieldContainer[str]
    sent: int
    failed: int
    waiting: int
    last_ns: int
    last_error: str
    def __init__(self, name: _Optional[str] = ..., kind: _Optional[str] = ..., target: _Optional[str] = ..., severity: _Optional[str] = ..., robots: _Optional[_Iterable[str]] = ..., causes: _Optional[_Iterable[str]] = ..., sent: _Optional[int] = ..., failed: _Optional[int] = ..., waiting: _Optional[int] = ..., last_ns: _Optional[int] = ..., last_error: _Optional[str] = ...) -> None: ...

class TestRouteRequest(_message.Message):
    __slots__ = ("route",)
    ROUTE_FIELD_NUMBER: _ClassVar[int]
    route: str
    def __init__(self, route: _Optional[str] = ...) -> None: ...

class TestRouteResponse(_message.Message):
    __slots__ = ("ok", "status", "error", "took_s")
    OK_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    TOOK_S_FIELD_NUMBER: _ClassVar[int]
    ok: bool
    status: str
    error: str
    took_s: float
    def __init__(self, ok: _Optional[bool] = ..., status: _Optional[str] = ..., error: _Optional[str] = ..., took_s: _Optional[float] = ...) -> None: ...

class GetLearningRequest(_message.Message):
    __slots__ = ("robot",)
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    robot: str
    def __init__(self, robot: _Optional[str] = ...) -> None: ...

class GetLearningResponse(_message.Message):
    __slots__ = ("series",)
    SERIES_FIELD_NUMBER: _ClassVar[int]
    series: _containers.RepeatedCompositeFieldContainer[SeriesLearning]
    def __init__(self, series: _Optional[_Iterable[_Union[SeriesLearning, _Mapping]]] = ...) -> None: ...

class SeriesLearning(_message.Message):
    __slots__ = ("series", "seen", "of", "score", "low", "high")
    SERIES_FIELD_NUMBER: _ClassVar[int]
    SEEN_FIELD_NUMBER: _ClassVar[int]
    OF_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    LOW_FIELD_NUMBER: _ClassVar[int]
    HIGH_FIELD_NUMBER: _ClassVar[int]
    series: str
    seen: int
    of: int
    score: float
    low: float
    high: float
    def __init__(self, series: _Optional[str] = ..., seen: _Optional[int] = ..., of: _Optional[int] = ..., score: _Optional[float] = ..., low: _Optional[float] = ..., high: _Optional[float] = ...) -> None: ...

class GetBandRequest(_message.Message):
    __slots__ = ("robot", "series", "from_ns", "to_ns")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    SERIES_FIELD_NUMBER: _ClassVar[int]
    FROM_NS_FIELD_NUMBER: _ClassVar[int]
    TO_NS_FIELD_NUMBER: _ClassVar[int]
    robot: str
    series: str
    from_ns: int
    to_ns: int
    def __init__(self, robot: _Optional[str] = ..., series: _Optional[str] = ..., from_ns: _Optional[int] = ..., to_ns: _Optional[int] = ...) -> None: ...

class GetBandResponse(_message.Message):
    __slots__ = ("points",)
    POINTS_FIELD_NUMBER: _ClassVar[int]
    points: _containers.RepeatedCompositeFieldContainer[BandPoint]
    def __init__(self, points: _Optional[_Iterable[_Union[BandPoint, _Mapping]]] = ...) -> None: ...

class BandPoint(_message.Message):
    __slots__ = ("stamp_ns", "value", "low", "high", "score")
    STAMP_NS_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    LOW_FIELD_NUMBER: _ClassVar[int]
    HIGH_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    stamp_ns: int
    value: float
    low: float
    high: float
    score: float
    def __init__(self, stamp_ns: _Optional[int] = ..., value: _Optional[float] = ..., low: _Optional[float] = ..., high: _Optional[float] = ..., score: _Optional[float] = ...) -> None: ...

class BacktestRequest(_message.Message):
    __slots__ = ("robot", "series", "start", "end", "checks_json", "detectors")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    SERIES_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    CHECKS_JSON_FIELD_NUMBER: _ClassVar[int]
    DETECTORS_FIELD_NUMBER: _ClassVar[int]
    robot: str
    series: _containers.RepeatedScalarFieldContainer[str]
    start: str
    end: str
    checks_json: str
    detectors: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, robot: _Optional[str] = ..., series: _Optional[_Iterable[str]] = ..., start: _Optional[str] = ..., end: _Optional[str] = ..., checks_json: _Optional[str] = ..., detectors: _Optional[_Iterable[str]] = ...) -> None: ...

class BacktestReport(_message.Message):
    __slots__ = ("robot", "from_ns", "to_ns", "samples", "findings", "alerts", "series", "cut", "took_s")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    FROM_NS_FIELD_NUMBER: _ClassVar[int]
    TO_NS_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    FINDINGS_FIELD_NUMBER: _ClassVar[int]
    ALERTS_FIELD_NUMBER: _ClassVar[int]
    SERIES_FIELD_NUMBER: _ClassVar[int]
    CUT_FIELD_NUMBER: _ClassVar[int]
    TOOK_S_FIELD_NUMBER: _ClassVar[int]
    robot: str
    from_ns: int
    to_ns: int
    samples: int
    findings: _containers.RepeatedCompositeFieldContainer[AlertFinding]
    alerts: _containers.RepeatedCompositeFieldContainer[BacktestAlert]
    series: _containers.RepeatedCompositeFieldContainer[BacktestSeries]
    cut: bool
    took_s: float
    def __init__(self, robot: _Optional[str] = ..., from_ns: _Optional[int] = ..., to_ns: _Optional[int] = ..., samples: _Optional[int] = ..., findings: _Optional[_Iterable[_Union[AlertFinding, _Mapping]]] = ..., alerts: _Optional[_Iterable[_Union[BacktestAlert, _Mapping]]] = ..., series: _Optional[_Iterable[_Union[BacktestSeries, _Mapping]]] = ..., cut: _Optional[bool] = ..., took_s: _Optional[float] = ...) -> None: ...

class BacktestAlert(_message.Message):
    __slots__ = ("cause", "severity", "title", "reason", "first_ns", "last_ns", "findings")
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    SEVERITY_FIELD_NUMBER: _ClassVar[int]
    TITLE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    FIRST_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_NS_FIELD_NUMBER: _ClassVar[int]
    FINDINGS_FIELD_NUMBER: _ClassVar[int]
    cause: str
    severity: str
    title: str
    reason: str
    first_ns: int
    last_ns: int
    findings: int
    def __init__(self, cause: _Optional[str] = ..., severity: _Optional[str] = ..., title: _Optional[str] = ..., reason: _Optional[str] = ..., first_ns: _Optional[int] = ..., last_ns: _Optional[int] = ..., findings: _Optional[int] = ...) -> None: ...

class BacktestSeries(_message.Message):
    __slots__ = ("series", "samples", "points")
    SERIES_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    series: str
    samples: int
    points: _containers.RepeatedCompositeFieldContainer[BandPoint]
    def __init__(self, series: _Optional[str] = ..., samples: _Optional[int] = ..., points: _Optional[_Iterable[_Union[BandPoint, _Mapping]]] = ...) -> None: ...
