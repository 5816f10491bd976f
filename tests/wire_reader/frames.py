"""Frames of FORMAT.md §2 to §4 and the bodies of control frames; the shapes of §13."""
import hmac
import struct
from dataclasses import dataclass
from typing import Any, Iterator

import schema
from packet import Decoder, Malformed

HEADER = struct.Struct("<IBBHQ")
REQUEST = struct.Struct("<Iq")
TRACE = struct.Struct("<QQ")
FIRST_PIECE = struct.Struct("<BBQQ")

TYPES = {1: "hello", 2: "welcome", 3: "reject", 11: "challenge", 12: "proof", 16: "request", 17: "reply", 18: "error", 19: "cancel", 20: "introduce",
         21: "answers", 32: "subscribe", 33: "subscribed", 34: "packet", 35: "unsubscribe", 36: "unsubscribed",
         37: "ended", 38: "credit", 48: "ping", 49: "pong", 50: "goodbye", 64: "piece", 72: "schema_request", 73: "schema"}
NUMBERS = {name: number for number, name in TYPES.items()}
DATAGRAMS = {4: "open", 5: "cookie", 6: "opened", 7: "closed", 8: "unknown", 9: "data", 10: "sign"}
FLAGS = {"request": {1: "traced"}, "packet": {1: "skipped"}, "pong": {1: "stalled"}, "piece": {1: "last", 2: "abandoned"}}
FLAGS_OVER_DATAGRAMS = {"request": {2: "numbered", 4: "again"}}
FLAGS_WITH_CLOCKS = {"request": {8: "until"}}
FLAGS_WITH_STAMPS = {"packet": {2: "stamped"}}
FLAGS_WITH_TRACES = {"request": {16: "wide"}}
FLAGS_WITH_PACKET_TRACES = {"packet": {4: "traced"}}
CLOCK, STAMPS, TRACES, PACKET_TRACES = 16, 32, 64, 128  # the features
WITHOUT_ID = {"hello", "welcome", "reject", "challenge", "proof", "goodbye", "schema_request", "schema"}
CODES = ("refused no_such_service type_mismatch timed_out peer_lost cancelled overloaded handler_failed malformed too_large "
         "protocol_error version_mismatch wrong_peer unreachable no_such_name name_taken name_server_lost superseded "
         "address_in_use invalid_argument would_block_self io_failed unauthorized not_connected "
         "access_denied").split()
MAGIC = 0x31455349
LONGEST_HANDSHAKE = 16384
SCHEME = "hmac-sha256"
NONCE = DIGEST = 32  # bytes


def _preset(form: str, value: int) -> str:
    return struct.pack("<" + form, value).hex()


_IDENTITY = "struct{path:string,host_name:string,process_key:string,incarnation:u64,epoch:u64}"
_LIMITS = (f"struct{{max_frame_bytes:u32={_preset('I', 1048576)},max_message_bytes:u64={_preset('Q', 268435456)},"
           f"max_calls:u32={_preset('I', 1048576)},max_subscriptions:u32={_preset('I', 65536)},"
           f"heartbeat_ns:u64={_preset('Q', 1000000000)}}}")
_CREDENTIALS = "struct{scheme:string,proof:vector<u8>}"
_INTRODUCTION = "struct{service:string,fingerprints:vector<u64>}"
_RESUMPTION = "struct{ticket:array<u8,16>,incarnation:u64,next_sequence:u64}"
_FAREWELL = "struct{code:u8,reason:string}"

#: What FORMAT.md calls "packet of {…}", written as schemas with its defaults as presets.
BODIES = {name: schema.parse(text) for name, text in {
    "hello": f"struct{{magic:u32={_preset('I', MAGIC)},oldest:u16={_preset('H', 1)},newest:u16={_preset('H', 1)},"
             f"features:u64={_preset('Q', 7)},self:{_IDENTITY},wanted_path:string,wanted_epoch:u64,wanted_incarnation:u64,"
             f"accepts:{_LIMITS},authentication:{_CREDENTIALS},reply_key:u64,dialled:vector<string>,host_key:string}}",
    "welcome": f"struct{{version:u16={_preset('H', 1)},features:u64={_preset('Q', 7)},self:{_IDENTITY},accepts:{_LIMITS},"
               f"authentication:{_CREDENTIALS},clock_ns:i64}}",
    "reject": _FAREWELL,
    "challenge": _CREDENTIALS,
    "proof": _CREDENTIALS,
    "ended": "struct{code:u8,reason:string,lost:u64}",
    "goodbye": _FAREWELL,
    "error": "struct{code:u8,execution:u8,reason:string}",
    "introduce": _INTRODUCTION,
    "answers": "struct{fingerprints:vector<u64>}",
    "schema_request": "struct{fingerprints:vector<u64>}",
    "schema": "struct{fingerprint:u64,text:string}",
    "subscribe": f"struct{{service:{_INTRODUCTION},policy:u8=01,depth:u32={_preset('I', 64)},credit:u64,min_interval_ns:u64,"
                 f"last_value:bool=01,resume:vector<{_RESUMPTION}>,request:vector<u8>}}",
    "subscribed": "struct{ticket:array<u8,16>,incarnation:u64,first_sequence:u64,resumed:bool,fingerprints:vector<u64>,"
                  "response:vector<u8>}",
}.items()}


@dataclass
class Frame:
    """A frame, or a message that came in pieces and is whole."""

    offset: int  # of its first byte (of its last piece) in the stream of its direction
    type: int
    flags: int
    reserved: int
    id: int
    body: bytes
    pieced: bool = False
    alone: bool = False  # a message beside the stream, of datagrams

    @property
    def name(self) -> str:
        return TYPES.get(self.type, f"type {self.type}")

    def __str__(self) -> str:
        return f"{self.name} id {self.id:#x}" + (" in pieces" if self.pieced else " in fragments" if self.alone else "")


class Envelope(Frame):
    """The frame that a datagram is; its offset counts the bytes of all datagrams of its sender."""

    @property
    def name(self) -> str:
        return DATAGRAMS.get(self.type, f"datagram of type {self.type}")


def encode_frame(name: str | int, id: int = 0, body: bytes = b"", flags: int = 0, reserved: int = 0) -> bytes:
    number = NUMBERS[name] if isinstance(name, str) else name
    return HEADER.pack(len(body), number, flags, reserved, id) + body


def prove(key: bytes, sender: str, transcript: bytes) -> bytes:
    """What proves the shared key, after the frames of the handshake so far (§5)."""
    return hmac.digest(key, f"ISE1 {sender}".encode() + b"\0" + transcript, "sha256")


class FrameReader:
    """Cuts a stream into frames."""

    def __init__(self):
        self.held = bytearray()
        self.offset = 0  # of the first byte held

    def feed(self, data: bytes):
        self.held += data

    def announced(self) -> tuple[int, int, int, int, int] | None:
        """The header at the front, as soon as it is whole."""
        return HEADER.unpack_from(self.held) if len(self.held) >= HEADER.size else None

    def frames(self) -> Iterator[Frame]:
        while (header := self.announced()) and len(self.held) >= HEADER.size + header[0]:
            size = HEADER.size + header[0]
            frame = Frame(self.offset, *header[1:], bytes(self.held[HEADER.size:size]))
            del self.held[:size]
            self.offset += size
            yield frame


def read_body(name: str, body: bytes) -> tuple[dict[str, Any], list[str]]:
    """The fields of a control frame, and what a sender of version 1 would not have done. Throws Malformed."""
    of, reader, out, remarks = BODIES[name], Decoder(body), {}, []
    for field, kind, preset in zip(of.names, of.inner, of.presets):
        if reader.at == len(body):
            remarks.append(f"has no field {field}")
            out[field] = Decoder(preset if preset is not None else kind.natural()).value(kind)
            continue
        try:
            out[field] = reader.value(kind)
        except Malformed as what:
            raise Malformed(f"{what}, in {field}") from None
    if reader.at != len(body):
        remarks.append(f"has {len(body) - reader.at} bytes behind the last field that version 1 knows")
    return out, remarks


def encode(of: schema.Type, value: Any) -> bytes:
    """Encodes what control frames are made of; a field that is missing takes its preset."""
    match of.kind:
        case "struct":
            return b"".join(encode(kind, value[name]) if name in value else (kind.natural() if preset is None else preset)
                            for name, kind, preset in zip(of.names, of.inner, of.presets))
        case "string":
            raw = value.encode() if isinstance(value, str) else value
            return struct.pack("<I", len(raw)) + raw
        case "vector":
            return struct.pack("<I", len(value)) + b"".join(encode(of.inner[0], item) for item in value)
        case "array":
            return b"".join(encode(of.inner[0], item) for item in value)
        case "bool":
            return struct.pack("<B", value)
        case _:
            return int(value).to_bytes(of.min_bytes(), "little", signed=of.kind.startswith("i"))


def control(name: str, id: int = 0, **fields: Any) -> bytes:
    """A frame whose body is a packet of these fields."""
    return encode_frame(name, id, encode(BODIES[name], fields))
