"""A request whose deadline has passed is not started: not behind a slow link, not after the provider's thread was busy, not after it was
stopped."""
from world import Rules, World


def tell(world: World):
    world.hosts("boat", "shore")
    world.way("boat", "shore", delay_ms=20)
    requesters = []
    for scheme in ("tcp", "udp"):
        for fault in ("slow", "busy", "stopped"):
            boat = world.party("provider", f"{fault}-{scheme}", f"{scheme}://{world.addresses['boat']}:0", "boat", rate=5).line()
            if fault == "slow":
                slow = boat
                continue
            name = f"asks-{fault}-{scheme}"
            requesters.append(name)
            world.party("requester", name, boat, "shore", deadline_ms=1000, every_ms=25, calls=280)
            if fault == "busy":
                busy = boat
        world.sleep(2)
        world.party("requester", f"blocks-{scheme}", busy, "shore", calls=1, blocks_ms=3000, deadline_ms=10000)
        world.processes[f"stopped-{scheme}"].stop()
        world.sleep(4)
        world.processes[f"stopped-{scheme}"].go_on()
        world.until(lambda: all("quiet" in (world.folder / f"{each}.log").read_text() for each in requesters), 20)
        world.sleep(1)
        # A queue of five seconds in front of the boat: most requests arrive too late.
        world.way("boat", "shore", rate=20_000, queue=100_000)
        name = f"asks-slow-{scheme}"
        requesters.append(name)
        world.party("requester", name, slow, "shore", deadline_ms=1000, every_ms=50, calls=160, bytes=2000)
        world.sleep(10)
        world.way("boat", "shore", rate=0)
        world.sleep(3)
    world.judge(Rules(deaf=("blocks-tcp", "blocks-udp"), min_calls=1000))
