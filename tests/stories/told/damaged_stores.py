"""Damaged files of node, page, Iridium proxy and boat end nobody: they are set aside loudly, and filled again from what others have."""
import json
import sqlite3
import urllib.request
from pathlib import Path

from world import Failed, Rules, World

PAGE = 4096


def brought_together(file: Path):
    """The log of a process that was killed becomes a part of its file."""
    with sqlite3.connect(file) as store:
        store.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    store.close()


def some_pages(file: Path):
    brought_together(file)
    pages = file.stat().st_size // PAGE
    with file.open("r+b") as disk:
        for page in range(max(1, pages // 3), max(2, pages * 2 // 3)):
            disk.seek(page * PAGE)
            disk.write(b"x" * PAGE)


def all_of_it(file: Path):
    brought_together(file)
    file.write_bytes(b"g" * 50_000)


def a_packet(file: Path):
    """As a flipped bit: the file is whole, and a row differs from its checksum."""
    with sqlite3.connect(file) as store:
        store.execute("UPDATE packets SET raw = zeroblob(length(raw)) WHERE position = (SELECT min(position) FROM packets)")
    store.close()


def tell(world: World):
    world.name_server()
    call, port = f"tcp://127.0.0.1:{world.free_port()}", world.free_port()
    files = {name: world.folder / f"{name}.db" for name in ("one", "two", "page", "hook", "boat")}
    for name, peer, more in (("one", "two", []), ("two", "one", ["--secondary"])):
        world.atirma(name, "communication-node", "--path", f"atirma/shore/{name}", "--peer", f"atirma/shore/{peer}", "--file", files[name],
                     "--proxy", "gprs=atirma/shore/gprs", *more)
    world.atirma("gprs", "gprs-proxy", "--store", "atirma/communication", "--boat-listen", call)
    world.atirma("hook", "iridium-proxy", "--imei", "300234010753370", "--database", files["hook"], "--webhook",
                 f"tcp://127.0.0.1:{world.free_port()}", "--send-by", "none")
    world.atirma("page", "web-server", "--telemetry", "atirma/communication", "--archive", files["page"], "--port", str(port), ready="http://")
    world.atirma("boat", "boat-simulator", "--serial", "", "--gprs", call, "--gprs-period", "1", "--speedup", "5", "--memory", files["boat"])

    def packets(name: str) -> set:
        try:
            with sqlite3.connect(f"file:{files[name]}?mode=ro", uri=True) as store:
                return set(store.execute("SELECT boot, sequence, raw FROM packets").fetchall())
        except sqlite3.Error:
            return set()

    def archived() -> int:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/status", timeout=5) as answer:
                return json.loads(answer.read())["archive"]["packets"]
        except OSError:
            return 0

    def set_aside(name: str) -> int:
        return sum(1 for each in world.folder.glob(f"{name}.db.damaged-*") if not each.name.endswith(("-wal", "-shm")))

    def hook_serves() -> bool:
        return world.next_of("atirma/shore/iridium", "iridium_account", wait=5) is not None

    if not world.until(lambda: archived() >= 40, 40):
        raise Failed("the boat's packets do not reach the page")

    victims = ("one", "page", "hook", "boat")
    for round_, damage in enumerate((some_pages, all_of_it), 1):
        before = archived()
        for name in victims:
            world.processes[name].kill()
            damage(files[name])
        for name in victims:
            world.processes[name].start()
        for name in victims:
            world.until(lambda: set_aside(name) >= round_, 20)
            world.expect(set_aside(name) == round_, f"{damage.__name__}: {set_aside(name)} files of {name} were set aside, not {round_}")
            world.expect(world.processes[name].child.poll() is None, f"{damage.__name__}: {name} has ended")
            said = world.until(lambda: "set aside" in (text := world.processes[name].err.read_text()) and f"{name}.db.damaged-" in text, 20)
            world.expect(said, f"{damage.__name__}: {name} does not log where its file is")
        had = packets("two")
        world.expect(world.until(lambda: had <= packets("one"), 20), f"{damage.__name__}: {len(had - packets('one'))} packets are not back at node one")
        world.expect(world.until(lambda: archived() > before, 20), f"{damage.__name__}: the page's archive has {archived()} packets of {before}")
        world.expect(world.until(hook_serves, 20), f"{damage.__name__}: the Iridium proxy serves nobody")

    # A flipped bit is not handed on: node one gets the packet from the other one.
    sound = packets("two")
    world.processes["one"].kill()
    a_packet(files["one"])
    world.processes["one"].start()
    checked = world.run("check", ["atirma", "store", "check", files["one"]])
    world.expect(checked.child.wait(20) == 1, "`atirma store check` finds nothing")
    world.until(lambda: world.call("atirma/shore/one", "track", {"max_packets": 100}, wait=5), 20)  # reads it
    world.expect(world.until(lambda: sound <= packets("one"), 20), "the packet that the disk changed is not back")
    world.expect(all(raw.strip(b"\0") for _, _, raw in packets("two")), "the packet that the disk changed reached the other node")
    world.judge(Rules())
