#!/usr/bin/env python3
"""Records sessions between real programs and checks them: stories.py --party FILE [--cli FILE --name-server FILE] [--keep FOLDER]"""
import argparse
import asyncio
import contextlib
import json
import os
import sys
import tempfile
import unittest
from pathlib import Path

from checker import Checker, check
from datagram_relay import DatagramRelay
from dialer import Peer, learn
from frames import Frame, control, encode_frame
from recording import read
from relay import Relay

OPTIONS = argparse.Namespace()


class Program:
    """A child process; leaving its context ends it."""

    def __init__(self, *arguments: str, **variables: str):
        self.arguments, self.variables = arguments, variables

    async def __aenter__(self) -> "Program":
        pipe = asyncio.subprocess.PIPE
        self.child = await asyncio.create_subprocess_exec(*self.arguments, stdin=pipe, stdout=pipe, env={**os.environ, **self.variables})
        return self

    async def __aexit__(self, *_):
        if self.child.returncode is None:
            self.child.terminate()
        await self.child.communicate()

    async def line(self) -> str:
        return (await self.child.stdout.readline()).decode().rstrip("\n")

    async def answer(self):
        self.child.stdin.write(b"done\n")
        await self.child.stdin.drain()

    async def endpoint(self, before: str) -> str:
        line = await self.line()
        if before not in line:
            raise AssertionError(f"{self.arguments} said '{line}' and not where it listens")
        return line.partition(before)[2]


async def publish(at: str, service: str, count: int):
    """Calls the provider from here: what it publishes then is nobody's reply."""
    peer = Peer()
    await peer.connect(at)
    answer = await peer.call(service, "struct{count:u32,bytes:u32,send:bool}", "struct{}", {"count": count})
    if answer.name != "reply":
        raise AssertionError(f"{service}: {answer}")
    await peer.leave()


async def cut_while_published(relay: Relay, service: str, count: int):
    """The session ends, and the next one begins when something was published in between."""
    relay.flowing.clear()
    relay.cut()
    await publish(relay.to, service, count)
    relay.flowing.set()


class RecordedSessions(unittest.IsolatedAsyncioTestCase):
    """Each story is played through a relay; every session of it must keep every rule, and contain what it is about."""

    async def asyncSetUp(self):
        asyncio.get_running_loop().set_debug(False)
        self.folder = Path(OPTIONS.keep or self.enterContext(tempfile.TemporaryDirectory()))
        self.folder.mkdir(parents=True, exist_ok=True)
        self.stack = contextlib.AsyncExitStack()
        await self.stack.__aenter__()
        self.addAsyncCleanup(self.stack.aclose)

    async def provider(self, listen: str = "tcp://127.0.0.1:0") -> tuple[Program, str]:
        made = await self.stack.enter_async_context(Program(OPTIONS.party, "provide", listen))
        return made, await made.endpoint("at ")

    async def relay(self, to: str, listen: str = "tcp://127.0.0.1:0", **options) -> Relay:
        made = Relay(to, self.folder, self.id().rpartition(".")[2], **options)
        await made.start(listen)
        return made

    async def over_datagrams(self, **weather) -> tuple[DatagramRelay, str]:
        """A relay of datagrams to a provider, and where else that one listens."""
        _, listening = await self.provider("udp://127.0.0.1:0,tcp://127.0.0.1:0")
        to, also = listening.split()
        made = DatagramRelay(to, self.folder, self.id().rpartition(".")[2], **weather)
        await made.start()
        return made, also

    async def play(self, story: str, relay: Relay | DatagramRelay, on_request=None) -> list[str]:
        """What the asker said, line by line."""
        said = []
        async with Program(OPTIONS.party, "ask", relay.at, story) as asker:
            while line := await asker.line():
                if line.startswith("!"):
                    await on_request(line[1:])
                    await asker.answer()
                else:
                    said.append(line)
            self.assertEqual(await asker.child.wait(), 0, f"{story}: {said}")
        self.assertEqual(said.pop(), "done")
        return said

    async def checked(self, relay: Relay | DatagramRelay, provider_at: str) -> list[Checker]:
        """The sessions of a relay, checked with the schemas that the provider tells."""
        await relay.stop()
        names = {packet.fingerprint for file in relay.sessions for packet in check(read(file)).packets}
        texts = await learn(provider_at, names)
        out = []
        for file in relay.sessions:
            checked = check(read(file), texts)
            self.assertEqual([str(each) for each in checked.findings], [], file)
            self.assertTrue(checked.over, f"{file} has no handshake")
            out.append(checked)
        return out

    def frames(self, sessions: list[Checker]) -> dict[str, int]:
        out: dict[str, int] = {}
        for session in sessions:
            for side in session.sides.values():
                for name, count in side.frames.items():
                    out[name] = out.get(name, 0) + count
        return out

    async def test_sealed_sessions(self):
        """This reader speaks them by itself: over tcp, a local socket and udp."""
        key = b"fedcba9876543210" * 4
        file = self.folder / "sealing-key"
        file.touch(0o600)
        file.write_bytes(key)
        listen = f"tcp://127.0.0.1:0,local://{self.folder}/sealed,udp://127.0.0.1:0"
        provider = await self.stack.enter_async_context(Program(OPTIONS.party, "provide", listen, ISE_KEY=str(file)))
        for at in (await provider.endpoint("at ")).split():
            with self.subTest(at):
                peer = Peer(sealed=key)
                await peer.connect(at)
                answer = await peer.call("helm", "struct{said:string}", "struct{said:string}", {"said": "x" * 3000})
                self.assertEqual(answer.name, "reply")
                self.assertIn(b"x" * 3000, answer.body)
                if at.startswith("udp"):
                    self.assertEqual(peer.from_peer.plain, 0)
                    self.assertGreater(len(peer.from_peer.came), 2)
                await peer.leave()
                with self.assertRaisesRegex(ConnectionError, "alert"):
                    await Peer(sealed=b"y" * 64).connect(at)

    async def test_shared_key(self):
        """Both programs and this reader know a key, by the old scheme; whoever does not is told so."""
        key = b"0123456789abcdef" * 4
        file = self.folder / "key"
        file.touch(0o600)
        file.write_bytes(key + b"\n")
        relay = await self.relay("", chunk_bytes=7)
        provider = await self.stack.enter_async_context(Program(OPTIONS.party, "provide", "tcp://127.0.0.1:0", ISE_KEY=str(file), ISE_KEY_LEGACY="1",
                                                                WIRE_PARTY_ADVERTISE=relay.at))
        relay.to = at = await provider.endpoint("at ")
        async with Program(OPTIONS.party, "ask", relay.at, "calls", ISE_KEY=str(file), ISE_KEY_LEGACY="1") as asker:
            while line := await asker.line():
                last = line
            self.assertEqual((await asker.child.wait(), last), (0, "done"))
        await relay.stop()
        (recorded,) = relay.sessions
        names = {packet.fingerprint for packet in check(read(recorded), key=key).packets}
        checked = check(read(recorded), await learn(at, names, key), key)
        self.assertEqual([str(each) for each in checked.findings], [])
        seen = self.frames([checked])
        self.assertEqual((seen["challenge"], seen["proof"], checked.over), (1, 2, True))
        self.assertNotIn(key, b"".join(chunk.data or b"" for chunk in read(recorded)))
        said = checked.sides["initiator"].greeting
        self.assertEqual(said["dialled"], [relay.at.encode()])
        self.assertTrue(said["host_key"])
        for wrong, why in ((None, "a shared key is demanded here"), (b"x" * 64, "the shared key here is another one")):
            with self.assertRaisesRegex(ConnectionError, why):
                await Peer(wrong).connect(at)

    async def test_calls(self):
        _, at = await self.provider()
        relay = await self.relay(at, chunk_bytes=7)  # no frame arrives in one part
        said = await self.play("calls", relay)
        (session,) = await self.checked(relay, at)
        mirrored = json.loads(said[0].removeprefix("mirror "))
        self.assertEqual(said[1:], ["hold hold", "sink refused", "break handler_failed", "back who, says the asker", "cancel cancelled", "never timed_out",
                                    "nowhere no_such_service"])
        packets = [packet for packet in session.packets if packet.what in ("the request", "the reply")]
        self.assertEqual([packet.value for packet in packets[:2]], [mirrored, mirrored])
        self.assertGreaterEqual(sum(packet.decoded for packet in packets), 6)
        seen = self.frames([session])
        self.assertEqual((seen["introduce"], seen["request"], seen["reply"]), (6, 11, 6))
        by_responder = {frame.name for side, frame, _ in session.history if side.name == "responder"}
        self.assertLessEqual({"introduce", "request"}, by_responder)  # a session is symmetric
        self.assertIn(seen["error"], (3, 4))  # both ends count the deadline
        self.assertIn(seen["cancel"], (1, 2))

    async def test_versions(self):
        _, at = await self.provider()
        relay = await self.relay(at)
        said = await self.play("versions", relay, lambda what: cut_while_published(relay, "publish_weather", 1))
        self.assertEqual(said, ["plan 3", "weather windy north", "weather 0 resumed 1", "moved type_mismatch", "weather type_mismatch"])
        sessions = await self.checked(relay, at)
        session = sessions[0]
        seen = self.frames(sessions)
        for name in ("schema_request", "schema", "answers", "subscribed", "ended"):
            self.assertIn(name, seen)
        self.assertTrue(all(packet.decoded for packet in session.packets))
        reply = next(packet for packet in session.packets if packet.what == "the reply")
        self.assertEqual(reply.value, {"count": 3, "note": "taken"})  # the provider's own layout

    async def test_big_messages_over_a_local_socket(self):
        with tempfile.TemporaryDirectory() as sockets:
            _, at = await self.provider(f"local://{sockets}/provider")
            relay = await self.relay(at, f"local://{sockets}/relay")

            async def on_request(what: str):
                relay.flowing.clear() if what == "hold" else relay.flowing.set()

            said = await self.play("big", relay, on_request)
            self.assertEqual((said[0], said[1]), ("echo 3145728", "held timed_out"))
            (session,) = await self.checked(relay, at)
        pieced = {frame.name for _, frame, _ in session.history if frame.pieced}
        self.assertLessEqual({"request", "reply", "packet"}, pieced)
        self.assertTrue(any(frame.name == "piece" and said and said.get("abandoned") for _, frame, said in session.history))

    async def test_subscriptions(self):
        _, at = await self.provider()
        relay = await self.relay(at)
        said = await self.play("subscriptions", relay)
        (session,) = await self.checked(relay, at)
        self.assertEqual(said[-2:], ["unlucky refused", "nowhere no_such_service"])
        self.assertIn("lossless received 200 lost 0 skipped 0 alive", said)
        seen = self.frames([session])
        for name in ("subscribe", "subscribed", "packet", "credit", "unsubscribe", "unsubscribed", "ended"):
            self.assertIn(name, seen)
        policies = {said["policy"] for _, frame, said in session.history if frame.name == "subscribe"}
        self.assertEqual(policies, {0, 1, 2, 3})
        self.assertTrue(any(said["skipped"] for _, frame, said in session.history if frame.name == "packet"))
        self.assertTrue(all(packet.decoded for packet in session.packets if packet.frame.name in ("packet", "unsubscribe", "unsubscribed")))

    async def test_resuming(self):
        first, at = await self.provider()
        relay = await self.relay(at)
        second_at = ""

        async def on_request(what: str):
            nonlocal second_at
            if what == "restart":
                _, second_at = await self.provider()
                relay.to = second_at
                first.child.kill()
                return
            await cut_while_published(relay, "publish_fixes", 20)  # more than is kept

        said = await self.play("resume", relay, on_request)
        self.assertEqual(said, ["resumed 1", "restarts 1"])
        sessions = await self.checked(relay, second_at)
        answers = [said for session in sessions for _, frame, said in session.history if frame.name == "subscribed"]
        self.assertEqual([answer["resumed"] for answer in answers], [False, True, False])
        gaps = [said["sequence"] for _, frame, said in sessions[1].history if frame.name == "packet"]
        self.assertEqual((answers[1]["first_sequence"], gaps), (11, list(range(23, 31))))
        self.assertEqual(answers[0]["ticket"], answers[1]["ticket"])
        self.assertNotEqual(answers[1]["ticket"], answers[2]["ticket"])

    async def test_leaving_while_schemas_are_awaited(self):
        """A subscriber that has left hears nothing more, whatever becomes of the schemas that its subscribe waited for."""
        _, at = await self.provider()
        relay = await self.relay(at)
        peer = Peer()
        await peer.connect(relay.at)
        peer.to_peer.write(control("subscribe", 1, service={"service": "pictures", "fingerprints": [1, 2, 3, 4, 5]}))
        await peer.next("schema_request")
        peer.to_peer.write(encode_frame("unsubscribe", 1))
        await peer.next("unsubscribed")
        peer.to_peer.write(control("schema", fingerprint=1, text="struct{}") + encode_frame("ping", 7))
        await peer.next("pong")
        await peer.leave()
        await relay.stop()
        (file,) = relay.sessions
        found = [str(each) for each in check(read(file)).findings if each.sender == "responder"]
        self.assertEqual(found, [])

    async def test_calls_over_datagrams_of_which_some_are_lost(self):
        relay, also = await self.over_datagrams(loss=0.1, repeats=0.1)
        said = await self.play("calls", relay)
        self.assertEqual(said[1:], ["hold hold", "sink refused", "break handler_failed", "back who, says the asker", "cancel cancelled", "never timed_out",
                                    "nowhere no_such_service"])
        (session,) = await self.checked(relay, also)
        requests = [said for side, frame, said in session.history if frame.name == "request" and side.name == "initiator"]
        self.assertGreaterEqual(len(requests), 10)
        self.assertTrue(all("number" in each and not each["again"] for each in requests), requests)
        self.assertGreaterEqual(sum(packet.decoded for packet in session.packets if packet.what in ("the request", "the reply")), 6)

    async def subscriptions_over_datagrams(self, **weather) -> tuple[list[str], list[Frame]]:
        """What the asker said, and the packets that came beside the stream."""
        relay, also = await self.over_datagrams(**weather)
        said = await self.play("subscriptions", relay)
        self.assertEqual(said[-2:], ["unlucky refused", "nowhere no_such_service"])
        (session,) = await self.checked(relay, also)
        alone = [frame for _, frame, _ in session.history if frame.alone]
        self.assertTrue(all(frame.name == "packet" for frame in alone))
        return said, alone

    async def test_subscriptions_over_datagrams(self):
        said, alone = await self.subscriptions_over_datagrams()
        self.assertEqual(said[1], "last received 16 lost 384 skipped 0 alive")
        self.assertGreater(len(alone), 16)

    async def test_a_burst_in_one_datagram_that_is_lost(self):
        """Its packets go together, and of those that are lost only the newest is sent again: FORMAT.md §13."""
        bursts = []

        def loses(sender: str, data: bytes) -> bool:
            """The first that has more than one packet; the others have 200 bytes."""
            if sender == "responder" and len(data) > 600:
                bursts.append(data)
            return bursts[:1] == [data]

        said, alone = await self.subscriptions_over_datagrams(loses=loses)
        self.assertEqual(len(bursts), 1)
        self.assertEqual(said[1], "last received 1 lost 399 skipped 0 alive")
        self.assertGreaterEqual(len(alone), 3)

    async def test_subscriptions_over_datagrams_of_which_some_are_lost(self):
        for seed in range(1, 5):
            with self.subTest(seed=seed):
                _, alone = await self.subscriptions_over_datagrams(loss=0.05, repeats=0.05, seed=seed)
                self.assertGreaterEqual(len(alone), 3)  # the newest of "latest", "last" and "limited" come at last

    async def test_big_messages_over_datagrams(self):
        relay, also = await self.over_datagrams(loss=0.02)
        said = await self.play("fragments", relay)
        self.assertEqual(said, ["echo 700000", "picture 200000"])
        (session,) = await self.checked(relay, also)
        self.assertTrue(any(frame.pieced for _, frame, _ in session.history))
        self.assertTrue(any(len(frame.body) > 200000 for _, frame, _ in session.history if frame.alone))

    async def test_a_call_goes_on_in_the_next_session_over_datagrams(self):
        relay, also = await self.over_datagrams()

        async def on_request(what: str):
            relay.cut()

        self.assertEqual(await self.play("again", relay, on_request), ["the word is ahoy"])
        first, second = await self.checked(relay, also)
        asked = [said["number"] for _, frame, said in first.history if frame.name == "request"]
        again = [said["number"] for _, frame, said in second.history if frame.name == "request" and said["again"]]
        self.assertIn(asked[0], again)  # "the word"; "hold", too, where it was sent before the asker saw that the session had ended

    async def test_a_session_over_datagrams_goes_on_from_another_address(self):
        relay, also = await self.over_datagrams()

        async def on_request(what: str):
            for flow in relay.flows.values():
                relay.move(flow)

        self.assertEqual(await self.play("again", relay, on_request), ["the word is ahoy"])
        (session,) = await self.checked(relay, also)
        self.assertTrue(session.datagrams.channels["initiator"].challenges)

    async def test_name_server(self):
        if not OPTIONS.cli:
            self.skipTest("the programs ise and ise_name_server are not built")
        async with Program(OPTIONS.name_server, "--listen", "tcp://127.0.0.1:0", "--fresh") as names:
            at = await names.endpoint("listens on ")
            relay = await self.relay(at)
            async with Program(OPTIONS.party, "provide", "tcp://127.0.0.1:0", "test/provider", ISE_NAME_SERVER=relay.at) as provider:
                await provider.endpoint("at ")
                for words in (["--wait", "describe", "test/provider"], ["list"], ["call", "test/provider", "helm", '{"said": "x"}'],
                              ["call", "nobody", "helm"]):
                    async with Program(OPTIONS.cli, "--name-server", relay.at, "--json", *words) as cli:
                        out, _ = await cli.child.communicate()
                        if words[0] == "call" and words[1] != "nobody":
                            self.assertEqual(json.loads(out), {"said": "x"})
            sessions = await self.checked(relay, at)
        self.assertGreaterEqual(len(sessions), 5)
        seen = self.frames(sessions)
        for name in ("introduce", "request", "reply", "error", "goodbye"):
            self.assertIn(name, seen)
        self.assertTrue(all(packet.decoded for session in sessions for packet in session.packets))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--party", required=True)
    parser.add_argument("--cli")
    parser.add_argument("--name-server")
    parser.add_argument("--keep", help="a folder that keeps the recordings")
    parser.parse_args(namespace=OPTIONS)
    suite = unittest.defaultTestLoader.loadTestsFromTestCase(RecordedSessions)
    return 0 if unittest.TextTestRunner(verbosity=2).run(suite).wasSuccessful() else 1


if __name__ == "__main__":
    sys.exit(main())
