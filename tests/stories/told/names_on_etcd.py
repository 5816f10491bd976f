"""Three name servers over three etcd: no grant is lost, whichever of them is killed or stopped, and epochs only grow."""
import time

from etcd import Cluster, History, NameServers
from world import Rules, World


def tell(world: World):
    cluster = Cluster(world)
    history = History(cluster)
    servers = NameServers(world, cluster)
    for n in range(3):
        world.party("provider", f"holder{n}", "tcp://127.0.0.1:0", names=servers.names, path=f"story/held{n}")
    first = world.until(lambda: len(held := servers.listed(0)) == 3 and held, 20)
    world.expect(first, "three providers are not registered")
    if not first:
        return
    world.expect(servers.all_list(first), "the three name servers do not list the same names")

    def granted(name: str, wait: float) -> float | None:
        """How long a provider that is new takes to be registered."""
        began = time.monotonic()
        world.party("provider", name, "tcp://127.0.0.1:0", names=servers.names, path=f"story/{name}")
        there = world.until(lambda: any(f"story/{name}" in servers.listed(n) for n in range(3)), wait)
        return time.monotonic() - began if there else None

    # The leader of etcd is killed.
    leader = cluster.leader()
    cluster.process(leader).kill()
    took = granted("after_kill", 15)
    world.expect(took, "nothing is granted after the leader of etcd was killed")
    print(f"granted and listed {took or 0:.1f} s after the leader of etcd was killed, with the start of the process")
    cluster.process(leader).restart()
    world.expect(servers.all_list(first), "names were lost, or granted anew, when the leader of etcd was killed")

    # The next one stands still: for longer than a lease, unless this etcd then ends leases that are held.
    pause = 5 if cluster.revokes_wrongly() else 30
    leader = world.until(cluster.leader, 10)
    cluster.process(leader).stop()
    stopped = time.monotonic()
    world.expect(granted("after_stop", 15), "nothing is granted while the leader of etcd is stopped")
    world.sleep(max(0.0, pause - (time.monotonic() - stopped)))
    cluster.process(leader).go_on()
    world.expect(servers.all_list(first), "names were lost, or granted anew, while the leader of etcd was stopped")

    # The name server of all nodes is killed, then all of them.
    world.processes["names0"].kill()
    world.expect(granted("other_server", 15), "nothing is granted after the first name server was killed")
    for n in (1, 2):
        world.processes[f"names{n}"].kill()
    began = time.monotonic()
    for n in range(3):
        world.processes[f"names{n}"].restart()
        world.processes[f"names{n}"].line("tcp://")
    world.expect(servers.all_list(first, 10), "names were lost, or granted anew, when all name servers were killed")
    print(f"all name servers list all names {time.monotonic() - began:.1f} s after they were started again")

    # The past is compacted away while a name server stands still.
    world.processes["names2"].stop()
    world.expect(granted("unseen", 15), "nothing is granted while a name server is stopped")
    now = cluster.ask(0, "kv/range", {"key": "Lw=="}) or {}
    world.expect(cluster.ask(0, "kv/compaction", {"revision": now.get("header", {}).get("revision", "1"), "physical": True}) is not None,
                 "etcd does not compact")
    world.processes["names2"].go_on()
    world.expect(world.until(lambda: "story/unseen" in servers.listed(2), 15), "a name server missed a grant that was compacted away")

    # No majority: nobody new, and everybody says so.
    for member in (1, 2):
        cluster.process(member).stop()
    said = world.until(lambda: "names are unconfirmed" in (text := world.ise("list", wait=5).stderr) and text, 20)
    world.expect(said, "ise list does not say that there is no majority")
    world.expect("has no majority" in world.ise("doctor", wait=10).stdout, "ise doctor does not find that there is no majority")
    for member in (1, 2):
        cluster.process(member).go_on()
    world.expect(world.until(lambda: "names are unconfirmed" not in world.ise("list", wait=5).stderr, 20), "the majority is back, and nobody says so")
    for name in [f"holder{n}" for n in range(3)]:
        world.expect(world.processes[name].child.poll() is None, f"{name} has ended")
    world.wrong += history.wrong()
    world.judge(Rules())
