"""FORMAT.md §7: introduce, request, reply, error, cancel, answers; the numbers of §13."""
import struct
from dataclasses import dataclass, field
from typing import Any

from frames import REQUEST, TRACE, TRACES

MOST_SERVICES = 4096


@dataclass
class Call:
    service: int
    answered: bool = False
    cancelled: bool = False
    abandoned: bool = False


@dataclass
class Caller:
    """What one side called; the answers of the other are entered here too."""

    services: list[list[int]] = field(default_factory=list)  # the fingerprints of each number
    answers: dict[int, list[int]] = field(default_factory=dict)  # the provider's own
    calls: dict[int, Call] = field(default_factory=dict)
    slots: dict[int, int] = field(default_factory=dict)  # the last id of each
    numbers: set[int] = field(default_factory=set)  # by which requests may be sent again


class CallRules:
    def __init__(self, checker):
        self.on = checker
        self.callers = {name: Caller() for name in checker.sides}

    def on_introduce(self, side, frame) -> Any:
        services = self.callers[side.name].services
        self.on.require(frame.id == len(services), side, frame, f"service numbers count: {len(services)} is the next")
        self.on.require(frame.id < MOST_SERVICES, side, frame, f"at most {MOST_SERVICES} services are introduced")
        if not (said := self.on.body(side, frame)):
            return None
        self.on.require(len(said["fingerprints"]) == 2, side, frame, "a service of calls has two fingerprints")
        services.append((said["fingerprints"] + [0, 0])[:2])
        return said

    def on_request(self, side, frame) -> Any:
        caller, traced, numbered = self.callers[side.name], bool(frame.flags & 1), bool(frame.flags & 2)
        wide = traced and bool(frame.flags & 16)
        prefix = REQUEST.size + (TRACE.size if traced else 0) + (8 if wide else 0) + (8 if numbered else 0)
        if not self.on.require(len(frame.body) >= prefix, side, frame, f"a request has at least {prefix} bytes"):
            return None
        service, left_ns = REQUEST.unpack_from(frame.body)
        said = {"service": service, "left_ns": left_ns}
        if traced:
            said["trace"], said["parent"] = TRACE.unpack_from(frame.body, REQUEST.size)
            self.on.require(said["trace"] != 0, side, frame, "a traced request has a trace")
        if wide:
            said["high"] = struct.unpack_from("<Q", frame.body, REQUEST.size + TRACE.size)[0]
            self.on.require(said["high"] != 0, side, frame, "the upper half of a wide trace is not zero")
        self.on.require(not frame.flags & 16 or (traced and self.on.has(TRACES)), side, frame, "wide is a flag of traced requests, with feature 64")
        self.on.require(left_ns >= 0 or bool(frame.flags & 8), side, frame, f"the time that is left is not negative: {left_ns}")
        if numbered:
            said |= {"number": struct.unpack_from("<Q", frame.body, prefix - 8)[0], "again": bool(frame.flags & 4)}
            self.on.require(said["number"] not in caller.numbers, side, frame, f"the number {said['number']} was used in this session")
            caller.numbers.add(said["number"])
        self.on.require(numbered or not frame.flags & 4, side, frame, "only what is numbered comes again")
        self.take_slot(side, frame, caller, service)
        if self.on.require(service < len(caller.services), side, frame, f"service {service} was not introduced"):
            self.on.user_packet(side, frame, "the request", caller.services[service][0], frame.body[prefix:])
        return said

    def take_slot(self, side, frame, caller: Caller, service: int):
        self.on.require(frame.id not in caller.calls, side, frame, "the id of a call is not used again")
        slot, most = frame.id & 0xFFFFFFFF, self.on.peer(side).accepts("max_calls")
        self.on.require(slot < most, side, frame, f"slot {slot} is not below the {most} calls that the peer accepts")
        if (before := caller.calls.get(caller.slots.get(slot))) and frame.id not in caller.calls:
            free = before.answered or before.cancelled or before.abandoned
            self.on.require(free, side, frame, f"slot {slot} is still used by call {caller.slots[slot]:#x}")
        caller.slots[slot] = frame.id
        caller.calls[frame.id] = Call(service)

    def on_reply(self, side, frame) -> Any:
        caller = self.callers[self.on.peer(side).name]
        if call := self.answer(side, frame, caller):
            own = caller.answers.get(call.service) or (caller.services + [[0, 0]])[call.service]
            self.on.user_packet(side, frame, "the reply", own[1], frame.body)
        return None

    def on_error(self, side, frame) -> Any:
        self.answer(side, frame, self.callers[self.on.peer(side).name])
        if said := self.on.body(side, frame):
            self.on.require(said["execution"] <= 1, side, frame, f"execution is 0 or 1, not {said['execution']}")
        return said

    def answer(self, side, frame, caller: Caller) -> Call | None:
        call = caller.calls.get(frame.id)
        if not self.on.require(call is not None and not call.abandoned, side, frame, "it answers a request that came"):
            return None
        self.on.require(not call.answered, side, frame, "a request is answered once")
        call.answered = True
        return call if call.service < len(caller.services) else None

    def on_cancel(self, side, frame) -> Any:
        self.on.require(not frame.body, side, frame, "it is empty")
        call = self.callers[side.name].calls.get(frame.id)
        if self.on.require(call is not None, side, frame, "it cancels a request that was written"):
            self.on.note(not call.cancelled, side, frame, "the call was cancelled before")
            call.cancelled = True
        return None

    def on_answers(self, side, frame) -> Any:
        caller = self.callers[self.on.peer(side).name]
        said = self.on.body(side, frame)
        if not said or not self.on.require(frame.id < len(caller.services), side, frame, f"service {frame.id} was not introduced"):
            return said
        self.on.require(len(said["fingerprints"]) == 2, side, frame, "a service of calls has two fingerprints")
        own = (said["fingerprints"] + [0, 0])[:2]
        before = caller.answers.get(frame.id) or caller.services[frame.id]
        self.on.note(own[1] != before[1], side, frame, "the response is the one that was introduced, or told before")
        caller.answers[frame.id] = own
        return said

    def abandoned(self, side, message):
        """A message in pieces was given up. A request is then as one that was never sent."""
        if message.type == 16:
            caller = self.callers[side.name]
            caller.calls[message.id] = Call(-1, abandoned=True)
