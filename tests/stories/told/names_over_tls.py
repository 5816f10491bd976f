"""An etcd that serves TLS to clients with a certificate and a password: name servers with both share names, others say why not."""
from etcd import Authority, Cluster, NameServers
from world import Rules, World

PASSWORD = "pass-of-the-names"
DAY = 86_400


def tell(world: World):
    authority = Authority(world, "robots")
    cluster = Cluster(world, authority=authority)
    cluster.demand_password("ise", PASSWORD)
    mine, strange = authority.issue_nameless("names"), Authority(world, "strangers").issue("names")
    named = authority.issue("named")
    believed = ("--store-ca-file", str(mine / "ca.pem"))
    shown = ("--store-certificate", str(mine / "certificate.pem"), "--store-key-file", str(mine / "key.pem"))
    user = {"ISE_STORE_PASSWORD": PASSWORD}
    servers = NameServers(world, cluster, *believed, *shown, "--store-user", "ise", **user)
    world.party("provider", "holder", "tcp://127.0.0.1:0", names=servers.names, path="story/held")
    held = world.until(lambda: "story/held" in (found := servers.listed(0)) and found, 20)
    world.expect(held and servers.all_list(held), "the three name servers do not share a name over TLS")

    # The member that serves all name servers is killed, so that its connections and watches move.
    cluster.process(0).kill()
    world.party("provider", "late", "tcp://127.0.0.1:0", names=servers.names, path="story/late")
    world.expect(world.until(lambda: "story/late" in servers.listed(2), 20), "nothing is granted after a member was killed")
    cluster.process(0).restart()

    def says(name: str, word: str, *options: str, store: str = cluster.store, ahead_s: int = 0):
        """A name server with these options grants nothing, and `ise list` says why."""
        listen = f"tcp://127.0.0.1:{world.free_port()}"
        command = ["ise_name_server", "--listen", listen, "--store", store, "--store-user", "ise", *options]
        made = world.run(name, command, **user)
        if ahead_s:
            made.line("tcp://")
            made.shift_clock(ahead_s)
            made.restart()
        made.line("tcp://")

        def told() -> str:
            return world.ise("list", wait=5, ISE_NAME_SERVER=listen).stderr

        world.expect(world.until(lambda: word in told(), 15), f"{name}: '{word}' is not said, but: {told()}")
        made.kill()

    def refuses(name: str, word: str, code: int, *options: str):
        """A name server with these options does not start, and says why."""
        made = world.run(name, ["ise_name_server", "--listen", "tcp://127.0.0.1:0", *options], **user)
        world.expect(world.until(lambda: made.child.poll() is not None, 10) and made.child.returncode == code, f"{name} does not end with {code}")
        world.expect(word in made.err.read_text(), f"{name}: '{word}' is not said, but: {made.err.read_text()}")

    says("wrong_authority", "was not issued by an authority that is believed here", "--store-ca-file", str(strange / "ca.pem"), *shown)
    says("no_certificate", "it demands a certificate, and this side has shown none", *believed)
    says("strange_certificate", "it refused the certificate of this side", *believed,
         "--store-certificate", str(strange / "certificate.pem"), "--store-key-file", str(strange / "key.pem"))
    says("common_name", "CommonName of client", *believed,
         "--store-certificate", str(named / "certificate.pem"), "--store-key-file", str(named / "key.pem"))
    says("other_name", "is not for 'localhost'", *believed, *shown, store=cluster.store.replace("127.0.0.1", "localhost"))
    says("expired", "has expired: it was valid until", *believed, *shown, ahead_s=31 * DAY)
    says("without_tls", "does it serve TLS", store=cluster.store.replace("etcds", "etcd"))

    refuses("no_file", f"cannot read {world.folder}/none.pem", 1, "--store", cluster.store, "--store-ca-file", str(world.folder / "none.pem"))
    (world.folder / "empty.pem").touch()
    refuses("empty_file", "there is no certificate in it", 1, "--store", cluster.store, "--store-ca-file", str(world.folder / "empty.pem"))
    refuses("no_authority", "--store-ca-file", 2, "--store", cluster.store)
    refuses("no_key", "--store-key-file", 2, "--store", cluster.store, *believed, *shown[:2])
    refuses("clear_text", "etcds://", 2, "--store", cluster.store.replace("etcds", "etcd"), *believed)

    for name in ("holder", "late"):
        world.expect(world.processes[name].child.poll() is None, f"{name} has ended")
    world.expect(held and servers.all_list(held), "a name was lost, or granted anew")
    world.judge(Rules())
