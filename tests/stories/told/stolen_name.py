"""After a restart of the name server nobody gets a held name by showing the epoch that everybody can list."""
from world import Failed, Rules, World


def tell(world: World):
    names = world.name_server(listen=f"tcp://127.0.0.1:{world.free_port()}")
    holder = world.party("provider", "holder", "tcp://127.0.0.1:0", names=names, path="story/held")
    for more in (0, 1):
        epoch = world.epoch_of("story/held")
        holder.stop()  # the thief is the first to ask
        world.processes["names"].restart()
        world.processes["names"].line("tcp://")
        claim = {"node": {"lease_key": 77, "host_name": "thief", "process_id": 1}, "lease": "2s",
                 "components": [{"path": "story/held", "incarnation": 7, "epoch": epoch + more, "endpoints": ["tcp://127.0.0.1:9"]}]}
        said = world.call(names, "ise.names.register", claim)
        if said is None:
            raise Failed("the name server does not answer the thief")
        world.expect(all(each["what"] != "granted" for each in said["grants"]), f"a thief who shows epoch +{more} is granted the name")
        holder.go_on()
        world.sleep(5)
        world.expect(holder.child.poll() is None, f"the holder has ended, for its name was given to a thief who shows epoch +{more}")
        if holder.child.poll() is not None:
            holder.restart()
            holder.line()
    world.judge(Rules())
