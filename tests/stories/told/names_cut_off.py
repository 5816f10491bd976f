"""A host with a minority of etcd and its name server is cut off, then a name server is slow, then two stand still: no grant is lost."""
import json

from etcd import Cluster, History, NameServers
from world import Rules, World

LEASE_S, LONGEST_BACK_OFF_S = 2, 5


def tell(world: World):
    world.hosts("a", "b", "c", "boat", "shore")
    cluster = Cluster(world, hosts=("a", "b", "c"))
    history = History(cluster)
    servers = NameServers(world, cluster)

    def hold(name: str, host: str, path: str, first: int):
        """A provider that talks to that name server first."""
        order = servers.each[first:] + servers.each[:first]
        world.party("provider", name, f"tcp://{world.addresses[host]}:0", host=host, names=",".join(order), path=path)

    def withdrew(name: str) -> bool:
        lines = (world.folder / f"{name}.grants.jsonl").read_text().split("\n")[:-1]
        return any(json.loads(line)["what"] == "withdrawn" for line in lines)

    hold("cut", "c", "story/cut", 2)
    hold("near", "boat", "story/near", 2)
    hold("far", "shore", "story/far", 0)
    first = world.until(lambda: len(found := servers.listed(0)) == 3 and found, 20)
    world.expect(first and servers.all_list(first), "three providers are not listed everywhere")
    if not first:
        return
    hold("successor", "shore", "story/cut", 0)
    stay = {path: epoch for path, epoch in first.items() if path != "story/cut"}

    # The name server of "cut" and of "near" has a minority only. "near" reaches others, "cut" does not.
    world.note("away", "cut")
    for other in ("a", "b"):
        world.cut("c", other)
    said = world.until(lambda: "has no majority" in world.ise("list", wait=5, host="c", ISE_NAME_SERVER=servers.each[2]).stderr, 20)
    world.expect(said, "the name server that is cut off does not say that it has no majority")
    world.expect(world.until(lambda: servers.listed(0).get("story/cut", 0) > first["story/cut"], 30), "nobody succeeds a holder that is cut off")
    world.expect({p: e for p, e in servers.listed(0).items() if p in stay} == stay, "a name was lost, or granted anew, beside the cut")
    world.expect(not withdrew("cut"), "a holder that is cut off withdrew: it cannot know")
    for other in ("a", "b"):
        world.heal("c", other)
    world.note("back", "cut")
    world.expect(world.until(lambda: withdrew("cut"), 20), "a superseded holder does not withdraw when its name server is back")
    now = servers.listed(0)
    world.expect(servers.all_list(now | stay), "the three name servers do not list the same names after the cut")

    # A name server that answers renewals too late. Its etcd is not slow: that is another fault (docs/names.md, limits).
    for client in ("boat", "shore"):
        world.way("a", client, delay_ms=400)
    world.sleep(8)
    for client in ("boat", "shore"):
        world.way("a", client, delay_ms=0)
    world.expect(servers.all_list(now), "a name was lost, or granted anew, while a name server was slow")

    # Two stand still for longer than the leases in the store, and find all of theirs overdue.
    for n in (0, 1):
        world.processes[f"names{n}"].stop()
    world.sleep(12)
    for n in (0, 1):
        world.processes[f"names{n}"].go_on()
    world.sleep(LEASE_S)
    world.expect(servers.all_list(now), "a name was lost, or granted anew, by name servers that had stood still")
    world.wrong += history.wrong(superseded_s=LEASE_S + LONGEST_BACK_OFF_S, min_grants=4, min_acts=500)
    world.judge(Rules())
