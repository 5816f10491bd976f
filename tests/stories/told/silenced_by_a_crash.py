"""A lossless subscriber that is killed, stopped or cut off does not silence the others of a publisher that waits for it."""
from world import Rules, World

FAULTS = ("killed", "stopped", "cut")


def tell(world: World):
    world.hosts("boat", "shore", *FAULTS)
    for fault in FAULTS:
        boat = world.party("provider", f"boat-{fault}", f"tcp://{world.addresses['boat']}:0", "boat", by="send", rate=500).line()
        world.party("subscriber", f"healthy-{fault}", boat, "shore", policy="last", depth=5000)
        world.party("subscriber", f"{fault}", boat, fault, policy="lossless", depth=64)
    world.sleep(2)
    world.processes["killed"].kill()
    world.processes["stopped"].stop()
    world.cut("boat", "cut")
    world.sleep(10)
    world.processes["stopped"].go_on()
    world.heal("boat", "cut")
    world.sleep(4)
    # A session that is gone holds up nobody, a silent one a second; the rest is for a busy machine.
    world.judge(Rules(killed=("killed",), silence_s={f"healthy-{fault}": 3 for fault in FAULTS}, min_packets=500))
