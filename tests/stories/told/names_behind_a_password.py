"""An etcd with authentication: name servers with the user's password share names, one with another password says why not."""
from etcd import Cluster, NameServers
from world import Rules, World

PASSWORD = "pass-of-the-names"


def tell(world: World):
    cluster = Cluster(world)
    cluster.demand_password("ise", PASSWORD)
    secret = world.folder / "password"
    secret.write_text(PASSWORD + "\n")
    secret.chmod(0o600)
    servers = NameServers(world, cluster, "--store-user", "ise", "--store-password-file", str(secret))
    world.party("provider", "holder", "tcp://127.0.0.1:0", names=servers.names, path="story/held")
    held = world.until(lambda: "story/held" in (found := servers.listed(0)) and found, 20)
    world.expect(held, "nothing is granted with the user's password")
    world.expect(held and servers.all_list(held), "the three name servers do not list the same names")

    # Tokens end with the members that gave them, as after their five minutes.
    for member in range(3):
        cluster.process(member).kill()
        cluster.process(member).restart()
    world.party("provider", "late", "tcp://127.0.0.1:0", names=servers.names, path="story/late")
    world.expect(world.until(lambda: "story/late" in servers.listed(2), 30), "nothing is granted after the tokens have ended")

    listen = f"tcp://127.0.0.1:{world.free_port()}"
    wrong = world.run("wrong", ["ise_name_server", "--listen", listen, "--store", cluster.store, "--store-user", "ise"], ISE_STORE_PASSWORD="other")
    wrong.line("tcp://")
    said = world.until(lambda: "etcd refuses" in (text := world.ise("list", wait=5, ISE_NAME_SERVER=listen).stderr) and text, 15)
    world.expect(said, "a name server with a wrong password does not say why nothing is granted: "
                 + world.ise("list", wait=5, ISE_NAME_SERVER=listen).stderr)
    world.expect(PASSWORD not in "".join(file.read_text(errors="replace") for file in world.folder.glob("*.err")), "a password is logged")
    world.judge(Rules())
