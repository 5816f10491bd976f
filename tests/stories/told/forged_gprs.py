"""Datagrams in the boat's name neither take its telecommands nor cost it a packet."""
import json
import socket
import time

from gprs import line, login
from world import Failed, Rules, World


def tell(world: World):
    world.hosts("shore", "boat", "thief")
    channel = (world.addresses["shore"], 7420)
    world.name_server("--fresh", host="shore", listen=f"tcp://{channel[0]}:7400")
    listeners = [word for scheme in ("tcp", "udp") for word in ("--boat-listen", f"{scheme}://{channel[0]}:{channel[1]}")]
    world.atirma("gprs", "gprs-proxy", *listeners, host="shore", ready="ready:")
    world.atirma("boat", "boat-simulator", "--gprs", f"tcp://{channel[0]}:{channel[1]}", "--gprs-period", "1", host="boat")

    def shore():
        return world.next_of("atirma/shore/gprs", "gprs_state", host="shore", wait=10) or {}

    def boat():
        return world.next_of("atirma/boat", "ground_truth", host="boat", wait=10) or {}

    if not world.until(lambda: shore().get("packets_received", 0) > 5, 20):
        raise Failed("the boat does not reach the shore")
    boot = shore()["boot"]
    with world.on("thief"):
        thief = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    thief.settimeout(0.2)

    def send(datagram: bytes):
        thief.sendto(datagram, channel)

    def heard() -> bytes:
        came = b""
        try:
            while True:
                came += thief.recv(2048)
        except TimeoutError:
            return came

    # A login as the boat, while the boat is there; then a telecommand.
    send(login(boot))
    request = {"id": 77, "command": {"kind": "set_mode", "mode": "hold"}, "valid_s": 20}
    asked = world.run("operator", ["ise", "--wait", "--timeout", "15s", "--json", "call", "atirma/shore/gprs", "telecommand", json.dumps(request)],
                      "shore", ISE_NAME_SERVER=world.names)
    stolen = b""
    end = time.monotonic() + 10
    while asked.child.poll() is None and time.monotonic() < end:
        stolen += (came := heard())
        if b"PATC,77," in came:
            send(line("PATR,77,0"))
    world.expect(b"PATC" not in stolen, "a datagram with the boat's name took its telecommand")
    done = world.until(lambda: '"result":"done"' in asked.said(), 10)
    world.expect(done, f"the telecommand was not done: {asked.said().strip()} {asked.err.read_text().strip()}")
    world.expect(not done or world.until(lambda: boat().get("mode") == "hold", 5), "the operator was told that it was done, and the boat did not do it")

    # An outage: the thief claims that the boat gave up the packets which it still holds.
    world.cut("boat", "shore")
    world.sleep(4)
    send(login(boot, 100000, 100000))
    world.sleep(1)
    world.heal("boat", "shore")
    before = shore().get("packets_received", 0)
    world.expect(world.until(lambda: shore().get("packets_received", 0) > before + 10, 25), "the boat's telemetry does not come again after an outage")
    world.expect(shore().get("given_up") == 0, f"{shore().get('given_up')} packets count as given up by the boat, which gave up none")
    acknowledged = boat().get("gprs_acknowledged", 0)
    received = shore().get("packets_received", 0)
    world.expect(received >= acknowledged, f"the boat was told that {acknowledged} packets are safe, and only {received} have come")
    thief.close()
    world.judge(Rules())
