#!/usr/bin/env python3
"""Reads recorded sessions of ISE.

    read_session.py check FILE...    says what FORMAT.md forbids; exit code 1 if there is something
    read_session.py print FILE...    every frame in order, packets as JSON where their schema came by
    read_session.py record LISTEN TO FOLDER    relays LISTEN to TO, both as tcp://host:port or local://path, or both as
                                               udp://host:port, until Ctrl-C
"""
import asyncio
import json
import sys
from pathlib import Path

from checker import check
from datagram_relay import DatagramRelay
from recording import read
from relay import Relay


def show(value) -> str:
    return json.dumps(value, default=lambda raw: raw.decode("utf-8", "replace") if isinstance(raw, bytes) else str(raw), ensure_ascii=False)


def print_session(file: Path):
    checked = check(read(file))
    packets = {id(packet.frame): packet for packet in checked.packets}
    for side, frame, said in checked.history:
        packet = packets.get(id(frame))
        inside = f" {show(packet.value)}" if packet and packet.decoded else f" packet {packet.fingerprint:#x} {packet.data[:40].hex()}" if packet else ""
        print(f"{'>' if side.name == 'initiator' else '<'} {frame.offset:8} {frame} flags {frame.flags} {len(frame.body)} bytes"
              + (f" {show(said)}" if said else "") + inside)


async def record(listen: str, to: str, folder: Path):
    folder.mkdir(parents=True, exist_ok=True)
    relay = (DatagramRelay if listen.startswith("udp:") else Relay)(to, folder)
    await relay.start(listen)
    print(f"recording {relay.at} -> {to} into {folder}", flush=True)
    await asyncio.Event().wait()


def main(arguments: list[str]) -> int:
    match arguments:
        case ["check", _, *_]:
            found = 0
            for file in arguments[1:]:
                checked = check(read(Path(file)))
                found += sum(each.grave for each in checked.findings)
                for each in checked.findings:
                    print(f"{file}: {each}")
            return 1 if found else 0
        case ["print", _, *_]:
            for file in arguments[1:]:
                print_session(Path(file))
            return 0
        case ["record", listen, to, folder]:
            try:
                asyncio.run(record(listen, to, Path(folder)))
            except KeyboardInterrupt:
                pass
            return 0
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except (OSError, ValueError) as what:
        sys.exit(f"read_session.py: {what}")
