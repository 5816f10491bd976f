"""All name servers over etcd start again with a clock that is a day behind: names stay, and the next epoch of a path is higher."""
from etcd import Cluster, History, NameServers
from world import Rules, World

DAY = 86_400


def tell(world: World):
    cluster = Cluster(world)
    history = History(cluster)
    servers = NameServers(world, cluster)
    for name in ("held", "given_up"):
        world.party("provider", name, "tcp://127.0.0.1:0", names=servers.names, path=f"story/{name}")
    first = world.until(lambda: len(found := servers.listed(0)) == 2 and found, 20)
    world.expect(first and servers.all_list(first), "two providers are not listed everywhere")
    for n in range(3):
        world.processes[f"names{n}"].kill()
        world.processes[f"names{n}"].shift_clock(-DAY)
        world.processes[f"names{n}"].restart()
        world.processes[f"names{n}"].line("tcp://")
    world.expect(first and servers.all_list(first), "names were lost, or granted anew, when the clocks were set back")

    world.processes["given_up"].kill()
    world.expect(world.until(lambda: "story/given_up" not in servers.listed(1), 20), "a killed provider keeps its name")
    world.party("provider", "next", "tcp://127.0.0.1:0", names=servers.names, path="story/given_up")
    again = world.until(lambda: servers.listed(2).get("story/given_up"), 20)
    world.expect(again and first and again > first["story/given_up"], f"its next epoch is {again}, after {first}")
    world.wrong += history.wrong()
    world.judge(Rules())
