"""Two communication nodes, of which one is set back in time: packets acknowledged with two copies survive the loss of either file."""
import shutil
import sqlite3
import time

from world import Failed, Rules, World

SOME = 60


class Feeder:
    """Hands packets to the first node as a proxy does, and writes down what it was answered."""

    def __init__(self, world: World):
        self.world, self.sequence = world, 0

    def log(self, line: str):
        with (self.world.folder / "feeder.log").open("a") as out:
            out.write(f"{time.monotonic_ns()} {line}\n")

    def feed(self):
        numbers = range(self.sequence + 1, self.sequence + SOME + 1)
        self.sequence += SOME
        packets = {"packets": [{"boot": 1, "sequence": n, "raw": "AAAA"} for n in numbers]}
        # A node in trouble refuses; the proxy asks again.
        if not (said := self.world.until(lambda: self.world.call("atirma/shore/one", "telemetry_store", packets), 20)):
            raise Failed("the first node keeps nothing any more")
        self.log(f"kept {said['copies']} " + " ".join(f"1.{n}" for n in numbers))

    def read(self, name: str):
        """Writes down the packets of a store, after some time for it to fetch the missing ones."""
        def rows():
            with sqlite3.connect(self.world.folder / f"{name}.db") as store:
                return store.execute("SELECT boot, sequence FROM packets").fetchall()

        self.world.until(lambda: len(rows()) >= self.sequence, 30)
        self.log(f"store {name} has " + " ".join(f"{boot}.{sequence}" for boot, sequence in rows()))


def tell(world: World):
    world.name_server()
    for name, peer, more in (("one", "two", []), ("two", "one", ["--secondary"])):
        world.atirma(name, "communication-node", "--path", f"atirma/shore/{name}", "--peer", f"atirma/shore/{peer}", "--file", world.folder / f"{name}.db",
                     "--proxy", "xbee=atirma/shore/xbee", *more)
    one, two = world.processes["one"], world.processes["two"]
    file, wal = world.folder / "one.db", world.folder / "one.db-wal"
    feeder = Feeder(world)

    def sees_the_other():
        state = world.next_of("atirma/shore/one", "communication_state")
        return state and state["peer_lives"]

    def back(process, change):
        process.kill()
        change()
        process.restart()
        world.until(sees_the_other, 20)

    def restore():
        for each in world.folder.glob("one.db*"):
            each.unlink()
        shutil.copy(world.folder / "backup.db", file)

    def half_the_wal():
        if not wal.exists() or wal.stat().st_size == 0:
            raise Failed("there is no write-ahead log to cut")
        with wal.open("r+b") as cut:
            cut.truncate(wal.stat().st_size // 2)

    world.until(sees_the_other, 20)
    feeder.feed()
    with sqlite3.connect(file) as now, sqlite3.connect(world.folder / "backup.db") as backup:
        now.backup(backup)
    feeder.feed()
    back(one, restore)
    feeder.feed()
    feeder.read("two")
    back(one, half_the_wal)
    feeder.feed()
    feeder.read("two")
    # The second one's disk is lost: the first has everything, also what it had forgotten itself.
    feeder.read("one")
    back(two, lambda: [each.unlink() for each in world.folder.glob("two.db*")])
    feeder.feed()
    feeder.read("one")
    feeder.read("two")
    world.judge(Rules())
