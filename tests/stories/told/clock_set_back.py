"""A wall clock that goes back over a restart gives no lower epochs, and no telecommand a longer life."""
import json

from world import Failed, Rules, World


def tell(world: World):
    # An epoch of a name server whose clock is then a day back, and nobody lives who could tell it the old one.
    names = world.name_server(listen=f"tcp://127.0.0.1:{world.free_port()}")
    holder = world.party("provider", "holder", "tcp://127.0.0.1:0", names=names, path="story/held")
    before = world.epoch_of("story/held")
    server = world.processes["names"]
    holder.kill()
    server.kill()
    server.shift_clock(-86_400)
    server.start()
    server.line("tcp://")
    holder.start()
    holder.line()
    after = world.epoch_of("story/held")
    world.expect(after > before > 0, f"the epoch went from {before} to {after}")

    # A telecommand that waits for a link that never comes.
    node = world.atirma("node", "communication-node", "--path", "atirma/shore/one", "--file", world.folder / "one.db", "--proxy", "xbee=atirma/shore/xbee")
    world.call("atirma/communication", "authority", {"action": "take"})
    asked = world.call("atirma/communication", "telecommand", {"id": 9, "command": {"kind": "set_mode", "mode": "hold"}, "valid_s": 10}, wait=8)
    if not asked:
        raise Failed("the telecommand is not taken")
    node.kill()
    node.shift_clock(-3_600)
    node.start()
    world.sleep(12)

    def stage() -> str:
        record = world.call("atirma/communication", "telecommand_record", {}, wait=5) or {}
        return json.dumps(record)

    world.expect('"state": "expired"' in stage(), f"a telecommand that was valid for 10 s is not expired after 12 s: {stage()[:300]}")
    world.judge(Rules())
