"""etcd without space (NOSPACE): names that are granted stay, none is granted, everybody says so, and it ends with the alarm."""
from etcd import Cluster, History, NameServers, coded
from world import Rules, World

QUOTA = 8 << 20


def tell(world: World):
    cluster = Cluster(world, "--quota-backend-bytes", str(QUOTA))
    history = History(cluster)
    servers = NameServers(world, cluster)
    world.party("provider", "holder", "tcp://127.0.0.1:0", names=servers.names, path="story/held")
    held = world.until(lambda: "story/held" in (found := servers.listed(0)) and found, 20)
    world.expect(held and servers.all_list(held), "the name is not listed everywhere")

    filling = {"key": coded("/filling"), "value": coded("x" * (256 << 10))}
    full = world.until(lambda: cluster.ask(0, "kv/put", filling, 5) is None and (cluster.ask(0, "maintenance/alarm", {"action": "GET"}, 5) or {}).get("alarms"), 60)
    world.expect(full, "etcd has no alarm though its quota is used up")
    world.party("provider", "late", "tcp://127.0.0.1:0", names=servers.names, path="story/late")
    said = world.until(lambda: "space" in (text := world.ise("list", wait=5).stderr) and text, 20)
    world.expect(said, "ise list does not say that the store has no space: " + world.ise("list", wait=5).stderr)
    found = world.until(lambda: "space exceeded" in (text := world.ise("doctor", wait=10).stdout) and text, 20)
    world.expect(found and "etcdctl" in found, "ise doctor does not find that the store has no space")
    world.expect(servers.all_list(held), "a name was lost, or granted anew, for want of space")
    world.expect("story/late" not in servers.listed(0), "a name was granted without space")

    # An administrator makes room.
    now = (cluster.ask(0, "kv/range", {"key": coded("/filling")}) or {})["header"]["revision"]
    world.expect(cluster.ask(0, "kv/compaction", {"revision": now, "physical": True}, 20) is not None, "etcd does not compact")
    for member in range(3):
        world.expect(cluster.ask(member, "maintenance/defragment", {}, 20) is not None, f"member {member} is not defragmented")
    for alarm in (cluster.ask(0, "maintenance/alarm", {"action": "GET"}, 20) or {}).get("alarms", []):
        cluster.ask(0, "maintenance/alarm", {"action": "DEACTIVATE", "memberID": alarm["memberID"], "alarm": "NOSPACE"}, 5)
    world.expect(world.until(lambda: "story/late" in servers.listed(1), 30), "nothing is granted though there is space again")
    world.expect(servers.all_list(held), "a name was lost, or granted anew, when there was space again")
    world.wrong += history.wrong()
    world.judge(Rules())
