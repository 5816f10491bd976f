"""Replays a recorded session and says where a side did what FORMAT.md forbids: §1 to §6 and the end here, the rest in the rules."""
import hmac
from typing import Any

import schema
from frames import (CLOCK, CODES, DIGEST, FIRST_PIECE, FLAGS, FLAGS_OVER_DATAGRAMS, FLAGS_WITH_CLOCKS, FLAGS_WITH_STAMPS, TRACES, FLAGS_WITH_TRACES, PACKET_TRACES, FLAGS_WITH_PACKET_TRACES, LONGEST_HANDSHAKE, MAGIC,
                    NONCE, NUMBERS, SCHEME, STAMPS, TYPES, WITHOUT_ID,
                    Frame, encode_frame, prove, read_body)
from packet import Malformed, decode, to_json
from recording import SIDES, Chunk, Datagram
from rules_calls import CallRules
from rules_datagrams import DatagramRules
from rules_schemas import SchemaRules
from rules_subscriptions import SubscriptionRules
from side import Finding, Message, Side, UserPacket

ONLY_FROM = {"hello": "initiator", "welcome": "responder", "reject": "responder", "challenge": "responder"}


class Broken(Exception):
    """What follows in this direction cannot be read."""


class Checker:
    """Feed it the chunks of a recording in order, then finish(). `texts`: schemas known from elsewhere; `key`: the shared key,
    to check what proves it."""

    def __init__(self, texts: dict[int, str] | None = None, key: bytes | None = None):
        self.key = key
        self.transcript = b""  # of the handshake
        self.keyed = False  # the hello offers to prove a key
        self.challenged = False
        self.proved = False  # by the initiator
        self.findings: list[Finding] = []
        self.packets: list[UserPacket] = []
        self.history: list[tuple[Side, Frame, Any]] = []  # every message with what was read in it
        self.sides = {name: Side(name) for name in SIDES}
        self.types: dict[int, schema.Type] = {}
        for fingerprint, text in (texts or {}).items():
            self.types[fingerprint] = schema.parse(text)
        self.over = False  # the handshake
        self.subscriptions = SubscriptionRules(self)
        self.rules = [CallRules(self), self.subscriptions, SchemaRules(self)]
        self.datagrams: DatagramRules | None = None  # where the session lies in them
        self.readers = {name: getattr(rules, "on_" + name) for rules in self.rules for name in NUMBERS
                        if hasattr(rules, "on_" + name)}
        self.readers |= {name: getattr(self, "on_" + name) for name in NUMBERS if hasattr(self, "on_" + name)}

    # What rules use.

    def peer(self, side: Side) -> Side:
        return self.sides["responder" if side.name == "initiator" else "initiator"]

    def require(self, holds: bool, side: Side, frame: Frame, rule: str, grave: bool = True) -> bool:
        if not holds:
            self.findings.append(Finding(frame.offset, side.name, str(frame), rule, grave))
        return holds

    def note(self, holds: bool, side: Side, frame: Frame, rule: str) -> bool:
        return self.require(holds, side, frame, rule, grave=False)

    def body(self, side: Side, frame: Frame) -> dict[str, Any] | None:
        """The fields of a control frame, or nothing if it is malformed."""
        try:
            fields, remarks = read_body(frame.name, frame.body)
        except Malformed as what:
            self.require(False, side, frame, f"its body is no packet of {frame.name}: {what}")
            return None
        for remark in remarks:
            self.note(False, side, frame, f"its body {remark}")
        if "code" in fields:
            self.require(1 <= fields["code"] <= len(CODES), side, frame, f"code {fields['code']} is not in the list of codes")
        return fields

    def user_packet(self, side: Side, frame: Frame, what: str, fingerprint: int, data: bytes):
        self.packets.append(UserPacket(side, frame, what, fingerprint, data))

    # The stream.

    def feed(self, chunk: Chunk | Datagram):
        side = self.sides[chunk.sender]
        if isinstance(chunk, Datagram):
            self.datagrams = self.datagrams or DatagramRules(self)
            self.datagrams.take(side, chunk)
            return
        if chunk.data is None:
            side.ended = True
            return
        if side.ended:
            raise ValueError(f"the recording has bytes of the {side.name} behind its end")
        self.stream(side, chunk.data)

    def stream(self, side: Side, data: bytes):
        side.reader.feed(data)
        try:
            if not side.broken:
                for frame in side.reader.frames():
                    self.take(side, frame)
                self.header(side)
        except Broken:
            side.broken = True

    def header(self, side: Side):
        """Checks a header whose body has not come."""
        if header := side.reader.announced():
            self.check_header(side, Frame(side.reader.offset, *header[1:], b""), header[0])

    def check_header(self, side: Side, frame: Frame, length: int):
        most = self.peer(side).accepts("max_frame_bytes") if self.over else LONGEST_HANDSHAKE
        ok = self.require(1 <= frame.type <= 127, side, frame, f"the type is 1 to 127, not {frame.type}")
        ok &= self.require(frame.reserved == 0, side, frame, f"the reserved field is 0, not {frame.reserved}")
        ok &= self.require(length <= most, side, frame, f"its body has {length} bytes where at most {most} are accepted")
        if not ok:
            raise Broken

    def take(self, side: Side, frame: Frame):
        self.check_header(side, frame, len(frame.body))
        self.require(not side.last, side, frame, f"nothing comes behind a {side.last}")
        self.require(not self.datagrams or frame.name != "packet", side, frame, "over datagrams a packet is a message beside the stream")
        if self.over:
            self.message(side, frame)
            return
        self.handshake_order(side, frame)
        self.message(side, frame)
        self.transcript += encode_frame(frame.type, frame.id, frame.body, frame.flags)

    def handshake_order(self, side: Side, frame: Frame):
        first = ("hello",) if side.name == "initiator" else ("challenge", "reject") if self.keyed else ("welcome", "reject")
        if not side.frames:
            self.require(frame.name in first, side, frame, f"the first frame of the {side.name} is {' or '.join(first)}")
        elif side.name == "initiator":
            self.require(frame.name == "proof", side, frame, "the initiator sends nothing more before it has the welcome")
        elif side.greeting:
            self.require(frame.name == "proof", side, frame, "the proof of the responder stands behind its welcome")

    def message(self, side: Side, frame: Frame):
        """A frame, or what pieces made."""
        name = frame.name
        side.frames[name] = side.frames.get(name, 0) + 1
        known = sum(FLAGS.get(name, {})) | sum(FLAGS_OVER_DATAGRAMS.get(name, {}) if self.datagrams else ())
        known |= sum(FLAGS_WITH_CLOCKS.get(name, {}) if self.has(CLOCK) else ())
        known |= sum(FLAGS_WITH_STAMPS.get(name, {}) if self.has(STAMPS) else ())
        known |= sum(FLAGS_WITH_TRACES.get(name, {}) if self.has(TRACES) else ())
        known |= sum(FLAGS_WITH_PACKET_TRACES.get(name, {}) if self.has(PACKET_TRACES) else ())
        if frame.type in TYPES:
            self.require(not frame.flags & ~known, side, frame, f"flags {frame.flags:#x} are not defined for it")
        if name in WITHOUT_ID:
            self.require(frame.id == 0, side, frame, "its id is 0")
        self.require(ONLY_FROM.get(name, side.name) == side.name, side, frame, f"only the {ONLY_FROM.get(name)} sends it")
        read = self.readers.get(name)
        if not read:
            self.note(False, side, frame, "no type of version 1; it is passed over")
        place = len(self.history)
        self.history.append((side, frame, None))
        if read:
            self.history[place] = (side, frame, read(side, frame))

    def has(self, feature: int) -> bool:
        """Whether both sides said it."""
        return all(side.greeting is not None and side.greeting["features"] & feature for side in self.sides.values())

    # §5

    def greet(self, side: Side, frame: Frame) -> dict[str, Any] | None:
        if not self.require(side.greeting is None, side, frame, "there is one handshake in a session"):
            return None
        if not (said := self.body(side, frame)):
            raise Broken
        side.greeting = said
        self.require(said["features"] & 7 == 7, side, frame, f"version 1 has the features 1, 2 and 4, not only {said['features']:#x}")
        self.require(said["self"]["incarnation"] != 0, side, frame, "an incarnation is not 0")
        self.require(said["accepts"]["max_frame_bytes"] >= 262144, side, frame, "max_frame_bytes is at least 262144")
        return said

    def on_hello(self, side: Side, frame: Frame):
        if said := self.greet(side, frame):
            self.require(said["magic"] == MAGIC, side, frame, f"magic is {MAGIC:#x}, not {said['magic']:#x}")
            self.require(said["oldest"] <= said["newest"], side, frame, "oldest is not above newest")
            offered = said["authentication"]
            self.keyed = offered["scheme"] != b""
            good = self.credentials(offered, NONCE) if self.keyed else not offered["proof"]
            self.require(good, side, frame, f"its authentication is empty, or of the scheme {SCHEME} with {NONCE} bytes")
        return said

    def on_welcome(self, side: Side, frame: Frame):
        said, asked = self.greet(side, frame), self.peer(side).greeting
        if not said:
            return None
        if self.require(asked is not None, side, frame, "a welcome answers a hello"):
            self.check_welcome(side, frame, asked, said)
        self.require(self.proved or not self.keyed, side, frame, "where a key is offered a welcome comes behind the proof of the initiator")
        self.require(not said["authentication"]["scheme"] and not said["authentication"]["proof"], side, frame, "the authentication of a welcome is empty")
        self.over = not self.keyed
        return said

    def credentials(self, said: dict[str, Any], length: int) -> bool:
        return said["scheme"] == SCHEME.encode() and len(said["proof"]) == length

    def on_challenge(self, side: Side, frame: Frame):
        self.require(self.keyed and not self.challenged, side, frame, "a challenge answers a hello that offers a key, once")
        said = self.body(side, frame)
        self.require(said is not None and self.credentials(said, NONCE), side, frame, f"a challenge has the scheme {SCHEME} and {NONCE} bytes")
        self.challenged = True
        return said

    def on_proof(self, side: Side, frame: Frame):
        said = self.body(side, frame)
        self.require(said is not None and self.credentials(said, DIGEST), side, frame, f"a proof has the scheme {SCHEME} and {DIGEST} bytes")
        if side.name == "initiator":
            self.require(self.challenged and not self.proved, side, frame, "a proof of the initiator answers a challenge, once")
            self.proved = True
        else:
            self.require(self.proved and not self.over and side.greeting is not None, side, frame, "a proof of the responder stands behind its welcome, once")
            self.over = side.greeting is not None
        if self.key and said:
            right = prove(self.key, side.name, self.transcript)
            self.require(hmac.compare_digest(bytes(said["proof"]), right), side, frame, "a proof is that of the key over the frames before it")
        return said

    def check_welcome(self, side: Side, frame: Frame, asked: dict[str, Any], said: dict[str, Any]):
        self.require(asked["oldest"] <= said["version"] <= asked["newest"], side, frame,
                     f"version {said['version']} is not in the range {asked['oldest']} to {asked['newest']} of the hello")
        for wanted, has in (("wanted_path", said["self"]["path"]), ("wanted_incarnation", said["self"]["incarnation"])):
            self.require(asked[wanted] in (b"", 0, has), side, frame, f"{wanted} is {asked[wanted]!r} and not {has!r}")
        wanted, has = asked["wanted_epoch"], said["self"]["epoch"]
        self.require(not wanted or not has or wanted == has, side, frame, f"wanted_epoch is {wanted} and not {has}")

    def on_reject(self, side: Side, frame: Frame):
        self.require(self.peer(side).greeting is not None, side, frame, "a reject answers a hello")
        self.require(side.greeting is None, side, frame, "there is one handshake in a session")
        side.last = "reject"
        return self.body(side, frame)

    # §6

    def on_piece(self, side: Side, frame: Frame):
        body = frame.body
        most = min(self.peer(side).accepts("max_message_bytes"), 4294901760)
        if frame.flags & 2:
            return self.on_abandoned(side, frame)
        if frame.id not in side.messages:
            if not self.require(len(body) >= FIRST_PIECE.size, side, frame, "a first piece has at least 18 bytes"):
                raise Broken
            begun = Message(*FIRST_PIECE.unpack_from(body))
            body = body[FIRST_PIECE.size :]
            self.require(begun.size <= most, side, frame, f"a message of {begun.size} bytes where at most {most} are accepted")
            self.require(begun.type != NUMBERS["piece"], side, frame, "no piece is inside pieces")
            self.require(1 <= begun.type <= 127, side, frame, f"the type in pieces is 1 to 127, not {begun.type}")
            side.messages[frame.id] = begun
            self.require(len(side.messages) <= 64, side, frame, "at most 64 messages are under way in pieces")
        message = side.messages[frame.id]
        message.body += body
        self.require(len(message.body) <= message.size, side, frame, f"{len(message.body)} bytes came of {message.size} announced")
        together = sum(len(each.body) for each in side.messages.values())
        self.require(together <= 2 * most, side, frame, f"the messages under way have {together} bytes, more than twice {most}")
        if frame.flags & 1:
            del side.messages[frame.id]
            self.require(len(message.body) >= message.size, side, frame, f"the last piece, but {len(message.body)} bytes came of {message.size}")
            self.message(side, Frame(frame.offset, message.type, message.flags, 0, message.id, bytes(message.body), True))
        return None

    def on_abandoned(self, side: Side, frame: Frame):
        message = side.messages.pop(frame.id, None)
        if not self.note(message is not None, side, frame, "nothing of this message came"):
            return None
        for rules in self.rules:
            rules.abandoned(side, message)
        return {"of": TYPES.get(message.type, message.type), "id": message.id, "abandoned": True}

    # §9, the end

    def on_ping(self, side: Side, frame: Frame):
        self.require(not frame.body, side, frame, "it is empty")
        side.pings.append(frame.id)

    def on_pong(self, side: Side, frame: Frame):
        if self.has(CLOCK) and not frame.flags & 1:
            self.require(len(frame.body) == 8, side, frame, "it is the sender's clock")
        else:
            self.require(not frame.body, side, frame, "it is empty")
        if frame.flags & 1:  # stalled: a sign of life, and no answer
            self.require(frame.id == 0, side, frame, "a stalled pong answers no ping: its id is 0")
            return
        waiting = self.peer(side).pings
        if self.require(frame.id in waiting, side, frame, "a pong has the id of a ping that waits for it"):
            waiting.remove(frame.id)

    def on_goodbye(self, side: Side, frame: Frame):
        side.last = "goodbye"
        self.require(not side.messages, side, frame, "a goodbye comes when everything was written, and a message is half there")
        return self.body(side, frame)

    def finish(self) -> list[Finding]:
        """Decodes the packets of services and gives what was found."""
        for side in self.sides.values():
            left = len(side.reader.held)
            if left and side.last and not side.broken:
                self.findings.append(Finding(side.reader.offset, side.name, f"{left} bytes", f"nothing comes behind a {side.last}"))
        for packet in self.packets:
            if not (of := self.types.get(packet.fingerprint)):
                continue
            try:
                packet.value = to_json(of, decode(of, packet.data))
                packet.decoded = True
            except Malformed as what:
                self.require(False, packet.side, packet.frame, f"{packet.what} is no {of.text()[:80]}: {what}")
        return self.findings


def check(chunks, texts: dict[int, str] | None = None, key: bytes | None = None) -> Checker:
    """Checks a whole recording."""
    checker = Checker(texts, key)
    for chunk in chunks:
        checker.feed(chunk)
    checker.finish()
    return checker
