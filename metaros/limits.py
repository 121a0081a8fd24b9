"""Every bound of the library and the link in one table; `docs/reference/limits.md` lists them with their reasons."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["LIMITS", "Limits"]

KIB = 1024
MIB = 1024 * KIB


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds in bytes, counts and seconds. Passed where a caller may want another value; never mutated."""

    sample_bytes: int = 16 * MIB  # one message; larger ones are a declared gap, reason too_large
    batch_bytes: int = 1 * MIB  # one Batch, or exactly one sample
    frame_bytes: int = 4 * MIB  # one message on gRPC or WebSocket
    chunk_bytes: int = 1 * MIB  # a piece of a sample that is larger than a batch
    batch_samples: int = 4096
    window_bytes: int = 16 * MIB  # unacknowledged data on one lane
    window_batches: int = 256
    linger_s: float = 0.005  # how long the agent waits to fill a batch
    outbox_event_bytes: int = 64 * MIB  # on the robot's disk: events; more are refused, and declared
    outbox_metric_bytes: int = 256 * MIB  # metrics; then thinned out, oldest first
    outbox_bulk_bytes: int = 2048 * MIB  # bulk; then the oldest is dropped
    outbox_segment_bytes: int = 16 * MIB  # one file of a log
    outbox_reserve_bytes: int = 16 * MIB  # kept free for events and for declaring losses on a full disk
    black_box_bytes: int = 512 * MIB  # on the robot's disk: the last minutes of everything; the oldest goes
    black_box_piece_bytes: int = 16 * MIB  # one file of it
    black_box_queue_bytes: int = 64 * MIB  # samples that wait for the black box's disk; more are lost to it
    recordings: int = 16  # clips on the robot's disk that wait for the gateway; more are refused
    recordings_bytes: int = 1024 * MIB  # the same, in bytes
    live_bytes: int = 8 * MIB  # live samples that wait in the agent's memory; the oldest yields
    ingress_bytes: int = 64 * MIB  # samples taken from Zenoh but not yet handled by an executor or the agent
    uplink_least_bytes_per_s: int = 1000  # the smallest byte budget that a robot may be given
    heartbeat_s: float = 5.0
    dead_after_s: float = 15.0
    viewer_queue_bytes: int = 8 * MIB  # one stream connection's backlog
    viewer_stall_s: float = 10.0  # a viewer that takes nothing for so long is cut
    history_page_bytes: int = 4 * MIB  # payloads of one page of stored messages; one message may be larger
    history_decoded_bytes: int = 1 * MIB  # one stored message shown as JSON, which is several times as long
    history_instant_bytes: int = 64 * MIB  # payloads of one answer about an instant
    segment_cache_bytes: int = 32 * MIB  # chunks of segments, unpacked, that were read last
    exports: int = 4  # MCAP exports that a gateway makes at a time
    export_hold_bytes: int = 64 * MIB  # of one export, read from the store and not yet written
    ros_name_chars: int = 256
    key_chars: int = 512
    schema_bytes: int = 256 * KIB
    schemas_bytes: int = 32 * MIB  # of all channels of one session
    statistics_bytes: int = 1 * MIB  # what an agent says of itself at a time
    channels_per_robot: int = 4096
    series_per_robot: int = 4096
    subscriptions_per_viewer: int = 256
    parameters_per_node: int = 4096
    image_pixels: int = 40_000_000  # of a compressed image, before it is decoded
    service_backlog: int = 1024  # requests of one service that wait for the executor
    action_goals: int = 1024  # goals of one action server, done ones with kept results included
    action_workers: int = 16  # goals of one action server whose plain execute callbacks run at a time
    json_bytes: int = 1 * MIB  # a request body
    anonymous_body_bytes: int = 64 * KIB  # of who has not signed in: a password, a token, a certificate's request
    bodies_bytes: int = 64 * MIB  # of all requests together that have come and are not done with
    bodies_address_bytes: int = 32 * MIB  # of one address
    body_idle_s: float = 30.0  # a body's next piece comes within so long
    body_s: float = 120.0  # and all of it
    head_bytes: int = 8 * KIB  # of a request: its line and headers
    head_s: float = 10.0  # within which it comes; a TLS handshake too
    keep_alive_s: float = 30.0  # a connection without a request is closed after so long
    answer_stall_s: float = 60.0  # a connection whose other end takes less than 64 KiB of an answer in it is cut
    connections: int = 4096  # over HTTP and WebSocket
    connections_address: int = 512  # of one address; those of this machine and of trusted proxies: three quarters
    strangers_waiting: int = 1024  # requests of who has not signed in that wait for their turn; more are refused
    strangers_waiting_each: int = 64  # of one address
    sockets_open: int = 512  # of one user, key or address, beside robots' links
    socket_message_bytes: int = 64 * KIB  # of a client on the stream and teleop sockets
    socket_frames_per_s: float = 150.0  # of a client, control frames and fragments too; a robot's link: 60 times
    links_waiting: int = 1024  # lanes of robots that have not said who they are
    links_waiting_address: int = 128  # of one address beyond this machine
    links_address_per_s: float = 200.0  # lanes that one address opens
    links_robot_per_s: float = 20.0  # lanes that one robot opens
    enrolment_tokens: int = 1000  # that wait for their robots; more are refused
    renewal_grace_s: float = 30 * 86_400.0  # how long after its end a robot's certificate can still be renewed
    identities_stale_s: float = 300.0  # a shared database unheard of for so long: then links of robots end
    teleop_fresh_s: float = 0.3  # D13: an actuator without a fresh command for so long is stopped
    lease_s: float = 3.0  # a teleop lease not renewed for so long is free again
    command_timeout_s: float = 10.0
    commands_remembered: int = 20_000  # ids of executed commands that an agent keeps, also over restarts
    commands_waiting: int = 256  # commands that wait for their ids to be on the robot's disk
    counted_keys: int = 16_384  # topics that `metaros top` counts; further ones show no rate
    shared_memory_bytes: int = 32 * MIB  # one session's pool; payloads that find no room take the network
    shared_memory_threshold_bytes: int = 16 * KIB  # smaller payloads are sent as ever
    recorder_queue_bytes: int = 256 * MIB  # samples that wait for a recorder's disk
    recorder_ring_bytes: int = 512 * MIB  # samples that a recorder in ring mode keeps in memory
    recorder_publishers: int = 4096  # of one recorded topic, followed by sequence number at a time
    recorded_chunk_bytes: int = 256 * MIB  # one chunk of an MCAP file that is read, uncompressed
    offered_qos_chars: int = 64 * KIB  # of one channel of such a file; longer texts are not read
    recording_bytes: int = 1024 * MIB  # one clip of a robot's black box
    recording_part_bytes: int = 256 * KIB  # a piece of it on the link
    recording_window_bytes: int = 1 * MIB  # pieces sent past what the gateway has told to be on its disk
    recordings_at_a_time: int = 4  # of one robot on their way to the gateway; further ones wait
    recordings_unfinished: int = 16  # of one robot, asked for and not yet stored
    recordings_queue_bytes: int = 64 * MIB  # pieces of all robots that wait for the gateway's disk
    recording_reserve_bytes: int = 256 * MIB  # of the gateway's disk: recordings leave it free
    recording_downloads: int = 16  # files of recordings that are being fetched at a time
    recording_age_s: float = 86_400.0  # a recording of which nothing was heard for so long is given up
    users: int = 1000
    password_chars: int = 256
    password_checks: int = 32  # passwords that wait to be hashed, two at a time; more are refused
    session_s: float = 604_800.0  # a browser stays signed in for at most so long
    session_idle_s: float = 43_200.0  # and so long without a request
    sessions_per_user: int = 32  # then the oldest ends
    sign_in_link_s: float = 900.0  # a one-time sign-in link works for so long
    login_failures: int = 10_000  # names and addresses whose failed sign-ins are remembered; the oldest go
    keys_per_user: int = 64
    keys_listed: int = 1000
    key_life_s: float = 315_360_000.0  # the longest life of a key that has an end: ten years
    robot_patterns: int = 64  # that say which robots a user or a key sees
    credential_chars: int = 512  # of a key or a session's token; longer ones are not even looked up
    attendance_s: float = 2.0  # how often it is asked whether who has a socket open may still be here
    principals_remembered: int = 4096  # keys and sessions that are not looked up again for two seconds
    audit_queue: int = 4096  # rows of the audit log that wait for the database; then nothing may be changed
    audit_refusals_per_hour: int = 600  # that get a row each; further ones are counted
    audit_heads: int = 1000  # exported heads that one proof compares, the newest
    broker_topics: int = 1024  # ZeroMQ topics that the broker bridges; messages of further ones are counted as dropped
    broker_prefixes: int = 4096  # different ZeroMQ subscriptions that the broker follows
    broker_queue_messages: int = 1000  # of one topic, waiting to be bridged in one direction
    broker_queue_bytes: int = 32 * MIB  # the same, in bytes
    broker_message_bytes: int = 64 * MIB  # one ZeroMQ message: JSON of a 16 MiB sample is about four times as long
    broker_linger_s: float = 2.0  # a topic stays subscribed for so long after its last ZeroMQ subscriber left
    subscription_rows: int = 1024  # subscriptions of one context that tell what they dropped
    seal_frames_per_key: int = 1 << 32  # payloads that one data key seals; then another one is made
    seal_key_s: float = 604_800.0  # and how long it seals
    seal_streams: int = 4096  # data keys that a sealer or an opener keeps
    seal_keys_kept: int = 8  # keys of a keyring before the one that seals
    type_cache: int = 4096  # compiled codecs and classes kept


LIMITS = Limits()
