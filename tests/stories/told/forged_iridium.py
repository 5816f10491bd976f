"""Posts and DirectIP messages that are not the gateway's count for nothing, and listeners that anybody could use are not opened."""
import struct

from world import Failed, World

IMEI = "300234010753370"


def post(token: str = "") -> bytes:
    body = (f"imei={IMEI}&momsn=7&transmit_time=26-11-21 10:00:00&iridium_latitude=28.1&iridium_longitude=-15.4&iridium_cep=2&data=0101"
            + (f"&JWT={token}" if token else "")).replace(" ", "%20").encode()
    return (b"POST /rockblock/mo HTTP/1.1\r\nHost: shore\r\nConnection: close\r\nContent-Type: application/x-www-form-urlencoded\r\n"
            + f"Content-Length: {len(body)}\r\n\r\n".encode() + body)


def directip() -> bytes:
    header = struct.pack(">I15sBHHI", 1, IMEI.encode(), 0, 8, 0, 1_790_000_000)
    parts = struct.pack(">BH", 1, len(header)) + header + struct.pack(">BH", 2, 2) + b"\1\1"
    return struct.pack(">BH", 1, len(parts)) + parts


def tell(world: World):
    world.hosts("shore", "gateway", "stranger")
    shore = world.addresses["shore"]
    hook, channel = (shore, 7480), (shore, 10800)
    world.name_server("--fresh", host="shore")
    key = world.folder / "gateway.pem"
    world.make_key(key)
    common = ["atirma", "run", "iridium-proxy", "--imei", IMEI, "--send-by", "none", "--database", world.folder / "iridium.db"]

    # Beyond loopback there is no channel for everybody.
    for name, words in (("open-hook", ["--webhook", f"tcp://{shore}:7480"]),
                        ("open-directip", ["--webhook", "", "--directip", f"tcp://{shore}:10800"])):
        refused = world.run(name, [*common, *words], "shore", ISE_NAME_SERVER=world.names)
        world.expect(world.until(lambda: refused.child.poll() is not None, 10), f"{name}: it listens to everybody")
        world.expect("gateway-addresses" in refused.err.read_text(), f"{name}: it does not say what to do")

    world.atirma("iridium", "iridium-proxy", *map(str, common[3:]), "--webhook", f"tcp://{shore}:7480", "--directip", f"tcp://{shore}:10800", "--jwt-key", str(key),
                 "--gateway-addresses", world.addresses["gateway"], host="shore")

    def account() -> dict:
        return world.next_of("atirma/shore/iridium", "iridium_account", host="shore", wait=10) or {}

    if account().get("messages") != 0:
        raise Failed("the proxy is not ready")
    unsigned, forged = post(), post("eyJhbGciOiJub25lIn0.eyJpc3MiOiJSb2NrIDciLCJkYXRhIjoiMDEwMSJ9.")
    for host, what in (("stranger", unsigned), ("gateway", unsigned), ("gateway", forged)):
        world.expect(world.ask(hook, what, b"HTTP/1.1 4", host), f"{host}: a post without the gateway's token is not refused")
    # The port of DirectIP: closed without an answer for a stranger; the gateway's messages are confirmed.
    world.expect(not world.ask(channel, directip(), b"\1\0\4\5\0\1\1", "stranger", wait=2), "a stranger's DirectIP message is confirmed")
    told = account()
    world.expect(told.get("messages") == 0, f"what strangers sent counts: {told}")
    world.expect(world.until(lambda: account().get("refused", 0) >= 3, 15), f"the refused posts are not counted: {account()}")
    world.expect(world.ask(channel, directip(), b"\1\0\4\5\0\1\1", "gateway"), "the gateway's DirectIP message is not confirmed")
    world.expect(world.until(lambda: account().get("messages") == 1, 10), f"the gateway's message does not count: {account()}")
