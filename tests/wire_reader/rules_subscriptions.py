"""FORMAT.md §9: subscriptions with their sequences, credits and tickets."""
import struct
from dataclasses import dataclass, field
from typing import Any

from frames import PACKET_TRACES, STAMPS

LOSSLESS, DISCONNECT = 2, 3


@dataclass
class Subscription:
    asked: dict[str, Any]
    credit: int
    terms: dict[str, Any] | None = None  # of subscribed
    own: list[int] = field(default_factory=lambda: [0] * 5)  # the provider's fingerprints
    over: bool = False  # ended or unsubscribed came
    leaving: bool = False  # unsubscribe was sent
    left: bool = False  # and answered
    expected: int = 0
    packets: int = 0  # of the subscribe frame that credits count from
    lost: int = 0
    skipped: int = 0


class SubscriptionRules:
    def __init__(self, checker):
        self.on = checker
        self.subscribers: dict[str, dict[int, Subscription]] = {name: {} for name in checker.sides}
        self.tickets: set[bytes] = set()

    def on_subscribe(self, side, frame) -> Any:
        mine = self.subscribers[side.name]
        self.on.require(frame.id not in mine, side, frame, "the id of a subscription is not used again")
        if not (said := self.on.body(side, frame)):
            return None
        fingerprints = said["service"]["fingerprints"]
        self.on.require(len(fingerprints) == 5, side, frame, "a service of subscriptions has five fingerprints")
        self.on.require(said["policy"] <= 3, side, frame, f"there is no policy {said['policy']}")
        self.on.require(len(said["resume"]) <= 1, side, frame, "resume has none or one")
        mine[frame.id] = Subscription(said, said["credit"])
        most = self.on.peer(side).accepts("max_subscriptions")
        alive = sum(not each.over and not each.leaving for each in mine.values())
        self.on.require(alive <= most, side, frame, f"{alive} subscriptions where the peer accepts {most}")
        self.on.user_packet(side, frame, "the subscribe packet", (fingerprints + [0])[0], said["request"])
        return said

    def of_provider(self, side, frame) -> Subscription | None:
        out = self.subscribers[self.on.peer(side).name].get(frame.id)
        self.on.require(out is not None, side, frame, "it belongs to a subscription that was asked for")
        if out:
            self.on.require(not out.over, side, frame, "the subscription is over")
        return out

    def ready_for(self, side, frame) -> bool | None:
        """Of a packet beside the stream: does it count? Nothing: not yet. Late ones do not, by their sequence or the end."""
        out = self.subscribers[self.on.peer(side).name].get(frame.id)
        if not out or not (out.terms or out.over):
            return None
        return not out.over and (len(frame.body) < 8 or struct.unpack_from("<Q", frame.body)[0] >= out.expected)

    def of_subscriber(self, side, frame) -> Subscription | None:
        out = self.subscribers[side.name].get(frame.id)
        self.on.require(out is not None, side, frame, "it belongs to a subscription that was asked for")
        return out

    def on_subscribed(self, side, frame) -> Any:
        out, said = self.of_provider(side, frame), self.on.body(side, frame)
        if not out or not said:
            return said
        self.on.require(out.terms is None, side, frame, "a subscribe is answered once")
        out.terms, out.expected = said, said["first_sequence"]
        introduced = out.asked["service"]["fingerprints"]
        out.own = (said["fingerprints"] or introduced) + [0] * 5
        self.on.require(len(said["fingerprints"]) in (0, 5), side, frame, "a service of subscriptions has five fingerprints")
        self.on.require(said["first_sequence"] >= 1, side, frame, "packets are numbered from 1")
        incarnation = side.greeting["self"]["incarnation"] if side.greeting else 0
        self.on.require(said["incarnation"] == incarnation, side, frame, "the incarnation is that of the handshake")
        self.check_ticket(side, frame, out, bytes(said["ticket"]), said)
        if said["resumed"]:
            self.on.require(not said["response"], side, frame, "what is resumed was answered before: its response is empty")
        else:
            self.on.user_packet(side, frame, "the subscribed packet", out.own[1], said["response"])
        return said

    def check_ticket(self, side, frame, out: Subscription, ticket: bytes, said: dict[str, Any]):
        wanted = out.asked["resume"]
        self.on.require(any(ticket), side, frame, "a ticket is random, not zero")
        if said["resumed"]:
            if self.on.require(bool(wanted), side, frame, "nobody asked to resume"):
                self.on.require(wanted[0]["incarnation"] == said["incarnation"], side, frame, "a subscription of another incarnation is not resumed")
                self.on.require(bytes(wanted[0]["ticket"]) == ticket, side, frame, "what is resumed keeps its ticket")
        else:
            self.on.require(ticket not in self.tickets, side, frame, "a ticket is given once")
            self.on.require(not wanted or bytes(wanted[0]["ticket"]) != ticket, side, frame, "what is not resumed has a fresh ticket")
        self.tickets.add(ticket)

    def on_packet(self, side, frame) -> Any:
        out = self.of_provider(side, frame)
        skips = bool(frame.flags & 1)
        stamped = self.on.has(STAMPS) and bool(frame.flags & 2)
        traced = self.on.has(PACKET_TRACES) and bool(frame.flags & 4)
        prefix = 8 + 4 * skips + 8 * stamped + 24 * traced
        if not self.on.require(len(frame.body) >= prefix, side, frame, f"a packet has at least {prefix} bytes") or not out:
            return None
        sequence = struct.unpack_from("<Q", frame.body)[0]
        skipped = struct.unpack_from("<I", frame.body, 8)[0] if skips else 0
        said = {"sequence": sequence, "skipped": skipped}
        self.on.require(stamped or not self.on.has(STAMPS), side, frame, "both sides tell times of publication, and it has none")
        if stamped:
            said["published_ns"] = struct.unpack_from("<q", frame.body, 8 + 4 * skips)[0]
            self.on.note(said["published_ns"] > 0, side, frame, "it was published before 1970")
        if traced:
            said["trace"], said["parent"], high = struct.unpack_from("<QQQ", frame.body, prefix - 24)
            said["trace"] |= high << 64
            self.on.require(said["trace"] & (1 << 64) - 1 != 0, side, frame, "a traced packet has a trace")
        if not self.on.require(out.terms is not None, side, frame, "the answer precedes the first packet"):
            return said
        if not self.on.require(sequence >= out.expected, side, frame, f"sequence {sequence} is below the expected {out.expected}"):
            return said
        missing = sequence - out.expected
        self.on.require(skipped <= missing, side, frame, f"{skipped} skipped of {missing} that are missing")
        if skips:
            self.on.note(skipped > 0, side, frame, "it says that 0 were skipped")
        policy, lost = out.asked["policy"], missing - min(skipped, missing)
        whole = policy == LOSSLESS or (policy == DISCONNECT and not (out.terms["resumed"] and not out.packets))  # what the old session lost
        whole &= not frame.alone  # what datagrams lost
        self.on.require(not lost or not whole, side, frame, f"policy {policy} loses nothing, and {lost} are missing")
        out.packets, out.lost, out.skipped, out.expected = out.packets + 1, out.lost + lost, out.skipped + skipped, sequence + 1
        if policy == LOSSLESS:
            self.on.require(out.packets <= out.credit, side, frame, f"the packet number {out.packets} where {out.credit} are granted")
        self.on.user_packet(side, frame, "the packet", out.own[2], frame.body[prefix:])
        return said

    def on_credit(self, side, frame) -> Any:
        out = self.of_subscriber(side, frame)
        if not self.on.require(len(frame.body) == 8, side, frame, "a credit has 8 bytes") or not out:
            return None
        total = struct.unpack("<Q", frame.body)[0]
        self.on.require(total >= out.credit, side, frame, f"a total of {total} takes back what was granted, {out.credit}")
        self.on.note(out.asked["policy"] == LOSSLESS, side, frame, "only lossless needs credit")
        self.on.note(not out.leaving, side, frame, "nobody needs credit behind unsubscribe")
        out.credit = max(out.credit, total)
        return {"total": total}

    def on_unsubscribe(self, side, frame) -> Any:
        if out := self.of_subscriber(side, frame):
            self.on.require(not out.leaving, side, frame, "it was said before")
            out.leaving = True
            if frame.body:
                fingerprints = out.asked["service"]["fingerprints"] + [0] * 5
                self.on.user_packet(side, frame, "the unsubscribe packet", fingerprints[3], frame.body)
        return None

    def on_unsubscribed(self, side, frame) -> Any:
        out = self.subscribers[self.on.peer(side).name].get(frame.id)  # it may have ended meanwhile
        if self.on.require(out is not None and out.leaving, side, frame, "it answers an unsubscribe"):
            self.on.require(not out.left, side, frame, "an unsubscribe is answered once")
            out.over = out.left = True
            if frame.body:
                self.on.user_packet(side, frame, "the unsubscribed packet", out.own[4], frame.body)
        return None

    def on_ended(self, side, frame) -> Any:
        if out := self.of_provider(side, frame):
            out.over = True
        return self.on.body(side, frame)

    def abandoned(self, side, message):
        """A packet that was given up counts as lost by its sequence; a subscribe as never sent."""
