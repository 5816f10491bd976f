"""A second client that declares another's path and incarnation uses up none of its call numbers over datagrams, gets none of its answers, and
holds none of them up."""
import json
import os
import struct
import time

from datagrams import Peer
from world import Failed, Rules, World

REQUEST = "struct{id:string,takes_ms:u32,blocks_ms:u32,load:vector<u8>}"
RESPONSE = "struct{id:string}"
FIRST_NUMBER = (1 << 40) + 1  # of the first connection of a component (FORMAT.md §13: ranges of 2^40)
LIMIT_S = 5


def word(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def tell(world: World):
    names = world.name_server("--fresh")
    boat = world.party("provider", "boat", "udp://127.0.0.1:0", rate=5).line()
    address = boat.removeprefix("udp://").rpartition(":")
    # Each call takes a while, so that some run, some are answered and some are still to come whenever the thief speaks.
    world.party("requester", "shore", boat, names=names, path="story/shore", takes_ms=400, deadline_ms=3000, every_ms=20)
    calls = world.folder / "shore.log"

    def made() -> int:
        return calls.read_text().count(" call ")

    def listed() -> dict:
        return next((each for each in json.loads(world.ise("--json", "list").stdout or "[]") if each["path"] == "story/shore"), {})

    if not (public := world.until(listed, 10)):
        raise Failed("the requester is not listed")
    if not world.until(lambda: calls.read_text().count(" ok ") > 60, 20):
        raise Failed("the requester's calls are not answered")
    identity = {"path": "story/shore", "host_name": "shore", "incarnation": int(public["incarnation"], 16), "epoch": int(public["epoch"])}
    log = (world.folder / "thief.log").open("a")

    def note(line: str):
        log.write(f"{time.monotonic_ns()} {line}\n")
        log.flush()

    for round, (reply_key, again) in enumerate(((0, False), (1, False), (int.from_bytes(os.urandom(8), "little"), False), (0, True))):
        thief = Peer((address[0], int(address[2])), {"self": identity, "reply_key": reply_key})
        thief.introduce("work", REQUEST, RESPONSE)
        now = made()
        numbers = range(FIRST_NUMBER + max(0, now - 80), FIRST_NUMBER + now + 150)
        asked = {}
        for id, number in enumerate(numbers):
            asked[id] = f"thief.{round}.{id}"
            note(f"call {asked[id]} {time.monotonic_ns() + LIMIT_S * 10**9}")
            thief.say(Peer.request(id, number, word(asked[id]) + struct.pack("<III", 0, 0, 0), LIMIT_S, again))
        thief.until(lambda: sum(frame.name in ("reply", "error") for frame in thief.frames) == len(asked), LIMIT_S)
        for frame in thief.frames:
            if frame.name == "reply":
                got = frame.body[4:].decode(errors="replace")
                note(f"done {asked[frame.id]} ok -")
                world.expect(got == asked[frame.id], f"the thief got the answer of another's call: {got}")
            elif frame.name == "error":
                note(f"done {asked[frame.id]} refused {('not_executed', 'unknown')[frame.body[1]]}")
        thief.close()
        # Those that follow have the numbers that the thief used.
        world.expect(world.until(lambda: made() > now + 160, 20), "the requester makes no more calls")
    log.close()
    world.hush()
    world.until(lambda: "quiet" in calls.read_text(), 5)
    world.sleep(1)
    outcomes = [line.split(" ")[3] for line in calls.read_text().splitlines() if " done " in line]
    world.expect(set(outcomes) == {"ok"}, f"of {len(outcomes)} calls of the requester {len(outcomes) - outcomes.count('ok')} failed")
    world.judge(Rules(min_calls=600))
