"""Lossless is every packet, or the end with the number of those that were lost; whatever is cut or stopped, whether the publisher waits or
not."""
from world import Rules, World


def tell(world: World):
    world.hosts("boat", "cut", "stopped", "slow")
    faults = ("cut", "stopped", "slow")
    for by in ("publish", "send"):
        for fault in faults:
            boat = world.party("provider", f"boat-{fault}-{by}", f"tcp://{world.addresses['boat']}:0", "boat", by=by, rate=400).line()
            world.party("subscriber", f"{fault}-{by}", boat, fault, policy="lossless", depth=256, takes_ms=5 if fault == "slow" else 0)
    world.sleep(2)
    world.cut("boat", "cut")
    for name, each in world.processes.items():
        if name.endswith(("stopped-publish", "stopped-send")) and not name.startswith("boat"):
            each.stop()
    world.sleep(5)
    world.heal("boat", "cut")
    world.sleep(5)
    for name, each in world.processes.items():
        if name.endswith(("stopped-publish", "stopped-send")) and not name.startswith("boat"):
            each.go_on()
    world.sleep(5)
    world.hush()
    world.sleep(3)
    # Without a publisher that waits, a subscription that falls behind by more than its depth ends: 400 packets a second against 256.
    world.judge(Rules(must_end=("cut-publish", "stopped-publish", "slow-publish"),
                      caught_up=tuple(f"{fault}-send" for fault in ("cut", "stopped")), min_packets=300))
