"""Every program that listens is out of descriptors for a while, with callers waiting; afterwards each of its listeners answers."""
from gprs import login
from world import World

POST = b"POST /rockblock/mo HTTP/1.1\r\nHost: shore\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"


def tell(world: World):
    ports = {name: world.free_port() for name in ("names", "host", "node", "page", "gprs", "hook", "nmea")}
    at = {name: ("127.0.0.1", port) for name, port in ports.items()}
    url = {name: f"tcp://127.0.0.1:{port}" for name, port in ports.items()}
    world.name_server("--fresh", listen=url["names"])
    (world.folder / "programs").mkdir()
    world.run("host", ["ise_instantiation_server", "--programs", world.folder / "programs", "--state", world.folder / "state", "--name", "shore",
                       "--name-server", world.names, "--listen", url["host"], "--log-level", "error"]).line("ise/host/shore")
    world.atirma("node", "communication-node", "--listen", url["node"], "--file", world.folder / "node.db")
    world.atirma("page", "web-server", "--port", ports["page"], ready="http://")
    world.atirma("gprs", "gprs-proxy", "--boat-listen", url["gprs"], ready="ready:")
    world.atirma("hook", "iridium-proxy", "--imei", "300234010753370", "--database", world.folder / "iridium.db", "--webhook", url["hook"], "--send-by", "none")
    world.atirma("nmea", "nmea-bridge", "--nmea-tcp", url["nmea"])

    def ise_answers(name):
        return world.ise("ping", "-n", "1", url[name], wait=10).returncode == 0

    answers = {
        "names": lambda: ise_answers("names"), "host": lambda: ise_answers("host"), "node": lambda: ise_answers("node"),
        "page": lambda: world.page_answers(at["page"]), "gprs": lambda: world.ask(at["gprs"], login(7), b"$PATA,7,"),
        "hook": lambda: world.ask(at["hook"], POST, b"HTTP/1.1 "), "nmea": lambda: world.ask(at["nmea"], b"", b"$"),
    }
    for name, answer in answers.items():
        world.expect(world.until(answer, 10), f"{name} does not answer before anything was done to it")
    for name in answers:
        with world.processes[name].no_descriptors():
            callers = [world.dial(None, at[name]) for _ in range(5)]
            world.sleep(0.5)
        for each in callers:
            each.close()
    for name, answer in answers.items():
        world.expect(world.processes[name].child.poll() is None, f"{name} has ended")
        world.expect(world.until(answer, 10), f"{name} does not answer any more after it was out of descriptors once")
