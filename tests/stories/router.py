#!/usr/bin/env python3
"""A router in user space between network namespaces, for faults of the way that this kernel does not offer.

usage: router.py SEED HOST=ADDRESS HOST=ADDRESS...      (root, and /dev/net/tun)
Each host gets a namespace with the TUN interface "way" and that address of 10.77.0.0/24; every packet between two hosts passes here.
It prints how to enter each namespace, as one JSON object: {"boat": "/proc/PID/fd/FD", …}. Then it takes one command a line and
answers each by "ok" (or what is wrong with it):
  set FROM TO NAME=VALUE...   of that direction: loss, duplicate, reorder (probabilities), delay_ms, jitter_ms, reorder_ms,
                              rate (bytes a second; 0: no limit), queue (bytes that wait for it; more are lost), up (0: a cut)
  reset A B                   the next packet of each TCP connection between the two becomes an RST to both ends
  counts                      what was done so far, as one JSON object
The same seed and the same packets meet the same fate. It ends with its standard input; the namespaces go with it.
"""
import ctypes
import fcntl
import heapq
import json
import os
import random
import selectors
import socket
import struct
import subprocess
import sys
import time
from dataclasses import dataclass, field

CLONE_NEWNET = 0x40000000
TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 1, 0x1000
TCP, FLAG_SYN, FLAG_RST, FLAG_ACK = 6, 2, 4, 16


def make_namespace(address: str) -> tuple[int, int]:
    """A new network namespace and its TUN device; the caller is in that namespace afterwards."""
    if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNET) != 0:
        raise OSError(ctypes.get_errno(), "unshare(CLONE_NEWNET)")
    namespace = os.open("/proc/self/ns/net", os.O_RDONLY)
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH22x", b"way", IFF_TUN | IFF_NO_PI))
    for words in (["link", "set", "lo", "up"], ["address", "add", f"{address}/24", "dev", "way"],
                  ["link", "set", "way", "txqueuelen", "2000", "mtu", "1400", "up"]):
        subprocess.run(["ip", *words], check=True, stdin=subprocess.DEVNULL)
    return namespace, device


def checksum(raw: bytes) -> int:
    total = sum(struct.unpack(f">{len(raw) // 2}H", raw))
    total = (total >> 16) + (total & 0xFFFF)
    return ~((total >> 16) + total) & 0xFFFF


def reset_packet(source: bytes, target: bytes, source_port: int, target_port: int, sequence: int) -> bytes:
    """A bare RST, as the other end would send it."""
    def tcp(sum_: int) -> bytes:
        return struct.pack(">HHIIBBHHH", source_port, target_port, sequence, 0, 5 << 4, FLAG_RST, 0, sum_, 0)

    def ip(sum_: int) -> bytes:
        return struct.pack(">BBHHHBBH4s4s", 0x45, 0, 40, 0, 0, 64, TCP, sum_, source, target)

    return ip(checksum(ip(0))) + tcp(checksum(source + target + struct.pack(">HH", TCP, 20) + tcp(0)))


@dataclass
class Direction:
    """What happens to the packets from one host to another."""

    dice: random.Random
    loss: float = 0
    duplicate: float = 0
    reorder: float = 0
    reorder_ms: float = 30
    delay_ms: float = 0
    jitter_ms: float = 0
    rate: float = 0
    queue: float = 65536
    up: float = 1
    free_at: float = 0  # when the line has sent what waits for it
    last_due: float = 0
    seen: set = field(default_factory=set)  # TCP connections, by their ports
    doomed: set = field(default_factory=set)  # those whose next packet becomes an RST

    def times(self, now: float, size: int, counts: dict[str, int]) -> list[float]:
        """When the packet comes out, once for each copy."""
        # Each packet draws the same numbers, whatever the settings are: a change of one leaves the fate by the others.
        lost, doubled, overtaken, late = (self.dice.random() for _ in range(4))
        if not self.up:
            counts["cut"] += 1
            return []
        if lost < self.loss:
            counts["lost"] += 1
            return []
        sent = now
        if self.rate:
            if (self.free_at - now) * self.rate > self.queue:
                counts["full"] += 1
                return []
            self.free_at = sent = max(now, self.free_at) + size / self.rate
        due = sent + (self.delay_ms + late * self.jitter_ms) / 1000
        if overtaken < self.reorder:
            counts["reordered"] += 1
            due += self.reorder_ms / 1000
        else:
            due = self.last_due = max(due, self.last_due)
        if doubled < self.duplicate:
            counts["duplicated"] += 1
            return [due, due]
        return [due]


class Router:
    def __init__(self, seed: int, hosts: dict[str, str]):
        self.namespaces, self.devices, self.names = {}, {}, {}
        for name, address in hosts.items():
            self.namespaces[name], self.devices[name] = make_namespace(address)
            self.names[socket.inet_aton(address)] = name
        self.ways = {(a, b): Direction(random.Random(f"{seed} {a} {b}")) for a in hosts for b in hosts if a != b}
        self.under_way: list[tuple[float, int, str, bytes]] = []
        self.counts = dict.fromkeys("passed cut lost full reordered duplicated reset".split(), 0)
        self.number = 0

    def take(self, host: str):
        for _ in range(64):  # commands and timers have their turn
            try:
                packet = os.read(self.devices[host], 65536)
            except BlockingIOError:
                return
            if len(packet) < 20 or packet[0] >> 4 != 4:
                continue  # the hosts' own IPv6
            to = self.names.get(packet[16:20])
            if to is None or to == host:
                continue
            way = self.ways[host, to]
            if packet[9] == TCP and self.reset(way, host, to, packet):
                continue
            for due in way.times(time.monotonic(), len(packet), self.counts):
                self.number += 1
                heapq.heappush(self.under_way, (due, self.number, to, packet))

    def reset(self, way: Direction, host: str, to: str, packet: bytes) -> bool:
        source, target, head = packet[12:16], packet[16:20], (packet[0] & 15) * 4
        source_port, target_port, sequence, acknowledged = struct.unpack_from(">HHII", packet, head)
        flags = packet[head + 13]
        key = (source_port, target_port)
        way.seen.add(key)
        if key not in way.doomed or flags & (FLAG_SYN | FLAG_RST) or not flags & FLAG_ACK:
            return False
        way.doomed.discard(key)
        self.ways[to, host].doomed.discard((target_port, source_port))
        self.counts["reset"] += 1
        self.put(to, reset_packet(source, target, source_port, target_port, sequence))
        self.put(host, reset_packet(target, source, target_port, source_port, acknowledged))
        return True

    def put(self, host: str, packet: bytes):
        try:
            os.write(self.devices[host], packet)
            self.counts["passed"] += 1
        except OSError:
            self.counts["full"] += 1

    def obey(self, line: str) -> str:
        words = line.split()
        match words:
            case ["set", a, b, *settings]:
                for setting in settings:
                    name, value = setting.split("=")
                    if name not in ("loss", "duplicate", "reorder", "reorder_ms", "delay_ms", "jitter_ms", "rate", "queue", "up"):
                        return f"there is no {name}"
                    setattr(self.ways[a, b], name, float(value))
            case ["reset", a, b]:
                for way in (self.ways[a, b], self.ways[b, a]):
                    way.seen, way.doomed = set(), way.seen
            case ["counts"]:
                return json.dumps(self.counts)
            case _:
                return f"no command: {line}"
        return "ok"

    def run(self):
        wakes = selectors.DefaultSelector()
        wakes.register(sys.stdin.fileno(), selectors.EVENT_READ, None)
        os.set_blocking(sys.stdin.fileno(), False)
        for host, device in self.devices.items():
            wakes.register(device, selectors.EVENT_READ, host)
        held = b""
        while True:
            wait = max(0.0, self.under_way[0][0] - time.monotonic()) if self.under_way else None
            for key, _ in wakes.select(wait):
                if key.data is not None:
                    self.take(key.data)
                    continue
                came = os.read(sys.stdin.fileno(), 4096)
                if not came:
                    return
                *lines, held = (held + came).split(b"\n")
                for line in lines:
                    try:
                        answer = self.obey(line.decode())
                    except (KeyError, ValueError) as wrong:
                        answer = f"cannot: {wrong!r}"
                    print(answer, flush=True)
            now = time.monotonic()
            while self.under_way and self.under_way[0][0] <= now:
                _, _, host, packet = heapq.heappop(self.under_way)
                self.put(host, packet)


def main():
    router = Router(int(sys.argv[1]), dict(word.split("=") for word in sys.argv[2:]))
    print(json.dumps({name: f"/proc/{os.getpid()}/fd/{fd}" for name, fd in router.namespaces.items()}), flush=True)
    router.run()


if __name__ == "__main__":
    main()
