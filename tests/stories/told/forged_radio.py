"""One forged telecommand over the radio does not lock the operators out, also not over the boat's loss of power."""
import itertools
import os
import struct
import tty

from boat import packet
from world import Failed, Rules, World

BOAT = 0x0013A20040000002  # the modem's address
AUTHORISED, PING = 0x42, 0


def telecommand(id: int, kind: int, authority: int) -> bytes:
    """One without arguments."""
    return packet(AUTHORISED, 0, id, struct.pack("<IB", authority, kind))


def frame(payload: bytes) -> bytes:
    data = struct.pack(">BBQHBB", 0x10, 1, BOAT, 0xFFFE, 0, 0) + payload
    return struct.pack(">BH", 0x7E, len(data)) + data + bytes([0xFF - sum(data) % 256])


def tell(world: World):
    world.name_server("--fresh")
    shore, boat = world.folder / "shore", world.folder / "boat"
    world.atirma("air", "xbee-link", "--shore-port", shore, "--boat-port", boat, "--distance", "50")
    afloat = world.atirma("boat", "boat-simulator", "--serial", boat, "--memory", world.folder / "boat.db")

    def heard() -> int:
        return (world.next_of("atirma/boat", "ground_truth", wait=10) or {}).get("telecommands_heard", 0)

    # A stranger's radio: it speaks nothing but the modem's protocol.
    stranger = os.open(shore, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(stranger)
    for attempt in range(1, 11):
        os.write(stranger, frame(telecommand(0xF0000000 + attempt, PING, 0xFFFFFFFF)))
        if world.until(lambda: heard() > 0, 3):
            break
    else:
        raise Failed("the boat does not hear the stranger")
    os.close(stranger)

    world.atirma("xbee", "xbee-proxy", "--serial", shore)
    world.atirma("node", "communication-node", "--path", "atirma/shore/one", "--file", world.folder / "one.db", "--proxy", "xbee=atirma/shore/xbee")
    ids = itertools.count(100)

    def obeys(mode: str) -> bool:
        """Like an operator who was refused: he takes the authority again."""
        world.call("atirma/communication", "authority", {"action": "take", "confirmed": True})
        said = world.call("atirma/communication", "telecommand", {"id": next(ids), "command": {"kind": "set_mode", "mode": mode}}, wait=10)
        return bool(said) and said["result"] == "done"

    world.expect(world.until(lambda: obeys("hold"), 20), "the operators are locked out after one forged telecommand")
    afloat.restart()
    world.expect(world.until(lambda: obeys("automatic"), 30), "the operators are locked out after one forged telecommand and a loss of power")
    world.judge(Rules())
