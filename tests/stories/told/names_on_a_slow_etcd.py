"""An etcd that takes longer for its answers than name servers wait: they say so, and no grant is lost."""
from etcd import Cluster, History, NameServers
from world import Rules, World

# A read at a member that is not the leader takes four ways, a renewal over a new connection to one on another host six: 2.4 and 3.6 s.
# SLOW_S: three leases in the store, and more.
DELAY_MS, SLOW_S = 600, 35


def tell(world: World):
    world.hosts("a", "b", "c", "boat")
    # Its own timeouts are those of a slow network, so that it goes on working.
    cluster = Cluster(world, "--heartbeat-interval", "500", "--election-timeout", "5000", hosts=("a", "b", "c"))
    history = History(cluster)
    servers = NameServers(world, cluster)
    for n in range(3):  # each talks to another name server
        order = ",".join(servers.each[n:] + servers.each[:n])
        world.party("provider", f"holder{n}", f"tcp://{world.addresses['boat']}:0", host="boat", names=order, path=f"story/held{n}")
    first = world.until(lambda: len(found := servers.listed(0)) == 3 and found, 20)
    world.expect(first and servers.all_list(first), "three providers are not listed everywhere")
    if not first:
        return

    def delay(ms: int):
        for one, other in (("a", "b"), ("a", "c"), ("b", "c")):
            world.way(one, other, delay_ms=ms)

    delay(DELAY_MS)
    world.sleep(SLOW_S)
    said = world.until(lambda: any("names are unconfirmed" in world.ise("list", wait=5, host=servers.hosts[n], ISE_NAME_SERVER=servers.each[n]).stderr
                                   for n in range(3)), 15)
    world.expect(said, "no name server says that the store is too slow")
    delay(0)
    world.expect(servers.all_list(first), "names were lost, or granted anew, while etcd was slow")
    world.party("provider", "late", f"tcp://{world.addresses['boat']}:0", host="boat", names=servers.names, path="story/late")
    world.expect(world.until(lambda: "story/late" in servers.listed(2), 15), "nothing is granted though etcd answers in time again")
    world.wrong += history.wrong(min_grants=4, min_acts=1000)
    world.judge(Rules())
