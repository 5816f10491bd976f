"""A relay for datagrams between two programs that records each session, loses and repeats some, and can cut one."""
import asyncio
import math
import random
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

from frames import DATAGRAMS, HEADER, encode_frame
from recording import HEAD_OF_DATAGRAMS, Datagram, Recorder

RECEIVE_BUFFER = 4 << 20  # what the relay itself lost would look like a number left out


def parse_endpoint(text: str) -> tuple[str, int]:
    """`udp://host:port` → (host, port)."""
    scheme, _, rest = text.partition("://")
    host, _, port = rest.rpartition(":")
    if scheme != "udp" or not host or not port.isdigit():
        raise ValueError(f"'{text}' is no endpoint that a relay of datagrams can serve: udp://host:port is expected")
    return host.strip("[]"), int(port)


def place_of(data: bytes) -> float:
    """Where a datagram of a session belongs among those that its sender sent: data count, and the rest begins or ends it."""
    type = HEADER.unpack_from(data.ljust(HEADER.size, b"\0"))[1]
    if DATAGRAMS.get(type) == "data":
        return int.from_bytes(data[HEADER.size : HEADER.size + 8], "little")
    return -1 if DATAGRAMS.get(type) in ("cookie", "opened") else math.inf


@dataclass
class Session:
    file: Path
    into: TextIO
    recorder: Recorder
    initiator: int
    responder: int = 0


@dataclass
class Flow:
    """One address that sends to the relay, and the sockets by which it reaches the provider; the last one is in use."""

    address: tuple
    sockets: list[socket.socket] = field(default_factory=list)
    session: Session | None = None  # the newest


@dataclass
class DatagramRelay:
    """Listens at `listen`, hands on to `to`, and writes session-1, session-2… into `folder`."""

    to: str
    folder: Path
    prefix: str = "session"
    loss: float = 0  # of the datagrams, in each direction, drawn by a seed
    repeats: float = 0
    seed: int = 1
    loses: Callable[[str, bytes], bool] = lambda sender, data: False  # these as well
    sessions: list[Path] = field(default_factory=list)
    open: list[Session] = field(default_factory=list)
    flows: dict[tuple, Flow] = field(default_factory=dict)
    at: str = ""

    async def start(self, listen: str = "udp://127.0.0.1:0"):
        self.draw = random.Random(self.seed)
        self.loop = asyncio.get_running_loop()
        host, port = parse_endpoint(listen)
        self.front = self.made(host)
        self.front.bind((host, port))
        self.loop.add_reader(self.front, self.read, self.front, self.from_initiator)
        self.at = f"udp://{host}:{self.front.getsockname()[1]}"

    def made(self, host: str) -> socket.socket:
        out = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        out.setblocking(False)
        out.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        return out

    def read(self, of: socket.socket, take):
        while True:
            try:
                data, address = of.recvfrom(65536)
            except BlockingIOError:
                return
            except OSError:  # nobody listens there: a provider that is not there
                continue
            take(data, address)

    def from_initiator(self, data: bytes, address: tuple):
        flow = self.flows.get(address)
        if not flow:
            flow = self.flows[address] = Flow(address)
            self.move(flow)
        self.hand_on(flow, "initiator", data, lambda: flow.sockets[-1].sendto(data, parse_endpoint(self.to)))

    def move(self, flow: Flow):
        """The provider sees another address from now on; what comes to the old one is still handed on."""
        host, _ = parse_endpoint(self.to)
        made = self.made(host)
        made.bind((host, 0))
        flow.sockets.append(made)
        self.loop.add_reader(made, self.from_responder, flow)

    def from_responder(self, flow: Flow):
        """A provider that has just learnt of a move sends to both addresses; its order is not the one in which they are read."""
        came: list[bytes] = []
        read = -1
        while len(came) > read:  # what was sent before a datagram that was read is there by then
            read = len(came)
            for one in flow.sockets:
                self.read(one, lambda data, _: came.append(data))
        for data in came if len(flow.sockets) == 1 else sorted(came, key=place_of):
            self.hand_on(flow, "responder", data, lambda: self.front.sendto(data, flow.address))

    def hand_on(self, flow: Flow, sender: str, data: bytes, send):
        lost = self.draw.random() < self.loss or self.loses(sender, data)
        if session := self.session_of(flow, sender, data):
            session.recorder.add(Datagram(time.monotonic_ns(), sender, data, lost))
        for _ in range(0 if lost else 2 if self.draw.random() < self.repeats else 1):
            try:
                send()
            except OSError:
                pass  # as a network that is full

    def session_of(self, flow: Flow, sender: str, data: bytes) -> Session | None:
        """By the ids that the datagrams say; the first open of an id begins one."""
        if len(data) < HEADER.size:
            return flow.session
        _, type, _, _, id = HEADER.unpack_from(data)
        name = DATAGRAMS.get(type)
        if name == "open" and (not flow.session or flow.session.initiator != id):
            file = self.folder / f"{self.prefix}-{len(self.sessions) + 1}.txt"
            into = open(file, "w", encoding="ascii", buffering=1)
            flow.session = Session(file, into, Recorder(into, HEAD_OF_DATAGRAMS), id)
            self.sessions.append(file)
            self.open.append(flow.session)
        if name == "opened" and flow.session and len(data) == HEADER.size + 8:
            flow.session.responder = int.from_bytes(data[HEADER.size :], "little")
        for session in self.open:  # of an old one something may still be under way
            if id == (session.responder if sender == "initiator" and name != "open" else session.initiator):
                return session
        return flow.session

    def cut(self):
        """Ends every session that is open: says to both sides, in the name of the other, that it has left."""
        for flow in self.flows.values():
            if session := flow.session:
                self.front.sendto(encode_frame(7, session.initiator), flow.address)
                flow.sockets[-1].sendto(encode_frame(7, session.responder), parse_endpoint(self.to))

    async def stop(self):
        for each in [self.front, *(one for flow in self.flows.values() for one in flow.sockets)]:
            self.loop.remove_reader(each)
            each.close()
        for session in self.open:
            session.into.close()
