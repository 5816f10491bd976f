"""Calls and subscriptions of every policy, over tcp and udp, by name and by endpoint, while everything fails in turn, as the seed says."""
import json

from world import Rules, World

MAKE_WORSE = {"loss": {"loss": 0.15}, "reorder": {"reorder": 0.2}, "duplicate": {"duplicate": 0.2}, "delay": {"delay_ms": 80, "jitter_ms": 60},
              "slow": {"rate": 60_000}, "cut": {"up": 0}}
MAKE_GOOD = {"loss": 0, "reorder": 0, "duplicate": 0, "delay_ms": 5, "jitter_ms": 3, "rate": 0, "up": 1}


def tell(world: World):
    world.hosts("boat", "shore", "coast")
    names = world.name_server(host="shore", listen=f"tcp://{world.addresses['shore']}:7400")
    asking, listening, exact = [], [], []
    for scheme in ("tcp", "udp"):
        boat = f"{scheme}://{world.addresses['boat']}:7500"
        world.party("provider", f"boat-{scheme}", boat, "boat", names=names, path=f"story/{scheme}", rate=150)
        for to, host in ((boat, "shore"), (f"story/{scheme}", "coast")):
            asking.append(f"asks-{scheme}-{host}")
            world.party("requester", asking[-1], to, host, names=names, every_ms=20, takes_ms=15, deadline_ms=1500)
        for policy in ("latest", "last", "lossless", "disconnect"):
            if scheme == "udp" and policy == "lossless":
                continue  # refused there
            listening.append(f"{policy}-{scheme}")
            world.party("subscriber", listening[-1], boat if policy == "last" else f"story/{scheme}", "shore", names=names, policy=policy, depth=256)
            if scheme == "tcp" or policy == "latest":
                exact.append(listening[-1])
    for a, b in (("boat", "shore"), ("boat", "coast"), ("shore", "coast")):
        world.way(a, b, **MAKE_GOOD)
    victims = {"boat": ["boat-tcp", "boat-udp"], "asks": asking, "hears": listening}
    deaf, killed = set(), set()
    faults = [*MAKE_WORSE, "reset", "names"] + [(what, whom) for what in ("stop", "kill") for whom in victims]
    world.dice.shuffle(faults)
    for fault in faults:
        world.sleep(world.dice.uniform(0.5, 1))
        length = world.dice.uniform(1, 2.5)
        if fault in MAKE_WORSE:
            for a, b in (("boat", "shore"), ("boat", "coast")):
                world.way(a, b, **MAKE_WORSE[fault])
            world.sleep(length)
            for a, b in (("boat", "shore"), ("boat", "coast")):
                world.way(a, b, **MAKE_GOOD)
        elif fault == "reset":
            world.reset("boat", "shore")
            world.sleep(length)
        elif fault == "names":
            world.processes["names"].kill()
            world.sleep(length)
            world.processes["names"].restart()
        else:
            what, whom = fault
            victim = world.processes[world.dice.choice(victims[whom])]
            if what == "stop":
                deaf.add(victim.name)
                victim.stop()
                world.sleep(length * 2)
                victim.go_on()
            else:
                killed.add(victim.name)
                victim.kill()
                world.sleep(length / 2)
                victim.restart()
    world.sleep(8)  # the longest pause before a new attempt, and a little
    done = json.loads(world.tell_router("counts"))
    world.expect(all(done[what] for what in ("lost", "reordered", "duplicated", "cut", "reset")), f"the router did not do all that it should: {done}")
    world.hush()
    world.sleep(3)
    world.judge(Rules(deaf=tuple(deaf), killed=tuple(killed), caught_up=tuple(exact), min_calls=2000, min_packets=500))
