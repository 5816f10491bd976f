#!/usr/bin/env python3
"""The checker finds each rule that is broken: hand-made sessions, one for every rule; and none in one that keeps them all."""
import ast
import random
import struct
import sys
import unittest
from pathlib import Path

import broken_datagrams
import broken_sessions
import checker
import schema
import sealing
from broken_datagrams import good_datagrams
from broken_sessions import KEY, TEXTS, good_session, keyed_session
from packet import Malformed, decode, to_json
from recording import Chunk, Datagram

BROKEN = broken_sessions.BROKEN | {f"datagrams: {name}": each for name, each in broken_datagrams.BROKEN.items()}
NOTED = broken_sessions.NOTED | {f"datagrams: {name}": each for name, each in broken_datagrams.NOTED.items()}

HERE = Path(__file__).resolve().parent


class WatchedChecker(checker.Checker):
    """Remembers where in the source a rule was found broken."""

    places: set[tuple[str, int]] = set()

    def require(self, holds, side, frame, rule, grave=True):
        if not holds:
            caller = sys._getframe(1)
            if caller.f_code.co_name == "note":
                caller = caller.f_back
            self.places.add((Path(caller.f_code.co_filename).name, caller.f_lineno))
        return super().require(holds, side, frame, rule, grave)


def run(session) -> checker.Checker:
    made = WatchedChecker(TEXTS, KEY)
    for number, each in enumerate(session):
        made.feed(each if isinstance(each, Datagram) else Chunk(number, *each))
    made.finish()
    return made


def rules_in_source() -> dict[tuple[str, int], str]:
    """Where the checker requires something, with the text."""
    out = {}
    for file in [HERE / "checker.py", *HERE.glob("rules_*.py")]:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("require", "note"):
                out[file.name, node.lineno] = ast.unparse(node)
    return {place: text for place, text in out.items() if not text.startswith("self.require(holds")}


class Sealing(unittest.TestCase):
    def test_the_ciphers_make_what_their_standards_say(self):
        aead = sealing.AesGcm(bytes.fromhex("feffe9928665731c6d6a8f9467308308"))  # test case 4 of the specification of GCM
        data = bytes.fromhex("d9313225f88406e5a55909c5aff5269a86a7a9531534f7da2e4c303d8a318a721c3c0c95956809532fcf0e2449a6b525b16aedf5aa0de657ba637b39")
        head, nonce = bytes.fromhex("feedfacedeadbeeffeedfacedeadbeefabaddad2"), bytes.fromhex("cafebabefacedbaddecaf888")
        sealed, tag = aead.seal(nonce, head, data)
        self.assertEqual(tag.hex(), "5bc94fbc3221a5db94fae95ae7121a47")
        self.assertEqual(aead.open(nonce, head, sealed, tag), data)
        scalar = bytes.fromhex("a546e36bf0527c9d3b16154b82465edd62144c0ac1fc5a18506a2244ba449ac4")  # RFC 7748, 5.2
        point = bytes.fromhex("e6db6867583030db3594c1a424b15f7c726624ec26b3353b10a903a6d0ab1c4c")
        self.assertEqual(sealing.x25519(scalar, point).hex(), "c3da55379de9c6908e94ea4df28d084f32eccf03491c71f754b4075577a28552")

    def test_a_sealed_datagram_opens_under_its_own_number_and_head_only(self):
        direction = sealing.Direction(bytes(range(32)))
        datagram = direction.made(22, 7, b"chunks")
        self.assertEqual(direction.opened(datagram), (7, b"chunks"))
        for bit in range(8 * len(datagram)):
            changed = bytearray(datagram)
            changed[bit // 8] ^= 1 << bit % 8
            with self.assertRaises(ConnectionError):
                direction.opened(bytes(changed))
        with self.assertRaises(ConnectionError):
            direction.next().opened(datagram)


class Checking(unittest.TestCase):
    def test_a_good_session_keeps_every_rule(self):
        checked = run(good_session())
        self.assertEqual([str(each) for each in checked.findings], [])
        self.assertTrue(all(packet.decoded for packet in checked.packets))
        self.assertGreater(len(checked.history), 40)

    def test_a_good_session_in_datagrams_keeps_every_rule(self):
        checked = run(good_datagrams())
        self.assertEqual([str(each) for each in checked.findings], [])
        sequences = [said["sequence"] for _, frame, said in checked.history if frame.name == "packet"]
        self.assertEqual(sequences, [4, 5, 7])  # the first was early, one in fragments, the last ones late
        numbers = [said["number"] for _, frame, said in checked.history if frame.name == "request"]
        self.assertEqual(numbers, [1])

    def test_damaged_datagrams_end_in_findings_never_in_a_crash(self):
        for seed in range(1000):
            draw = random.Random(seed)
            session = good_datagrams()
            one = draw.choice(session)
            damaged = bytearray(one.data)
            for _ in range(draw.randint(1, 4)):
                damaged[draw.randrange(len(damaged))] = draw.choice((0, 1, 0x7F, 0x80, 0xFF, draw.randrange(256)))
            one.data = bytes(damaged)
            with self.subTest(seed=seed):
                run(session)

    def test_a_session_with_a_key_keeps_every_rule(self):
        checked = run(keyed_session())
        self.assertEqual([str(each) for each in checked.findings], [])
        self.assertTrue(checked.over)

    def test_it_is_the_same_byte_by_byte(self):
        single = [(sender, bytes([byte])) for sender, data in good_session() if data for byte in data]
        checked = run(single)
        self.assertEqual([str(each) for each in checked.findings], [])
        self.assertEqual([str(frame) for _, frame, _ in checked.history], [str(frame) for _, frame, _ in run(good_session()).history])

    def test_each_broken_session_is_found(self):
        for name, (session, rule) in BROKEN.items():
            with self.subTest(name):
                found = [str(each) for each in run(session).findings if each.grave]
                self.assertTrue(any(rule in each for each in found), f"'{rule}' is not in {found}")

    def test_what_is_odd_but_allowed_is_noted(self):
        for name, (session, rule) in NOTED.items():
            with self.subTest(name):
                found = run(session).findings
                self.assertFalse(any(each.grave for each in found), found)
                self.assertTrue(any(rule in str(each) for each in found), found)

    def test_no_rule_of_the_checker_is_left_untried(self):
        WatchedChecker.places.clear()
        for session, _ in [*BROKEN.values(), *NOTED.values()]:
            run(session)
        untried = {place: text for place, text in rules_in_source().items() if place not in WatchedChecker.places}
        self.assertEqual(untried, {})

    def test_a_finding_names_byte_side_frame_and_rule(self):
        session, _ = BROKEN["a pong that nobody asked for"]
        (found,) = run(session).findings
        welcome = len(session[1][1])
        self.assertEqual(str(found), f"violation: byte {welcome} from the responder, pong id 0x9: a pong has the id of a ping that waits for it")

    def test_damage_ends_in_findings_never_in_a_crash(self):
        for seed in range(1000):
            draw = random.Random(seed)
            session = good_session()
            at = draw.randrange(len(session))
            sender, data = session[at]
            if not data:
                continue
            damaged = bytearray(data)
            for _ in range(draw.randint(1, 4)):
                damaged[draw.randrange(len(damaged))] = draw.choice((0, 1, 0x7F, 0x80, 0xFF, draw.randrange(256)))
            session[at] = (sender, bytes(damaged))
            with self.subTest(seed=seed):
                run(session)


class Packets(unittest.TestCase):
    def test_the_fingerprint_of_the_document(self):
        of = schema.parse("struct position{name:string,latitude_deg:f64,longitude_deg:f64=0000000000000840}")
        self.assertEqual(schema.fingerprint(of), 0x2D1043D21368154B)

    def test_a_text_comes_back(self):
        for text in ("struct a{x:enum mood:i8{angry=-3,calm=0}=fd,y:map<string,variant<i32,tuple<>>>}", "tuple<>", "struct{}",
                     "array<vector<bool>,3>", "duration<i64,1/1000>", "time<f64,60/1>", "opaque<test/chain,1>", "enum:u8{}"):
            self.assertEqual(schema.parse(text).text(), text)

    def test_texts_that_are_none(self):
        for text in ("", "struct", "struct{x:u8,}", "struct{x:u8,x:u8}", "struct {x:u8}", "vector<u8", "vector<u9>", "u8 ", "array<u8,01>",
                     "enum:u8{b=1,a=0}", "enum:f32{}", "struct{x:u8=00}", "struct{x:u8=0}", "struct{x:u8=0A}", "variant<>", "map<u8>",
                     "duration<i32,1/1>", "opaque<,1>", "vector<" * 300 + "u8" + ">" * 300):
            with self.subTest(text[:40]), self.assertRaises(schema.SchemaError):
                schema.parse(text)

    def test_bytes_that_are_no_packet(self):
        for text, data in (("bool", "02"), ("u32", "000000"), ("u8", "0000"), ("string", "05000000"), ("vector<u16>", "ffffffff0000"),
                           ("set<u8>", "020000000101"), ("map<u8,u8>", "0200000001000100"), ("optional<u8>", "0201"), ("variant<u8,u8>", "0200"),
                           ("vector<tuple<>>", "ffffffff"), ("array<bool,2>", "0102")):
            with self.subTest(text), self.assertRaises(Malformed):
                decode(schema.parse(text), bytes.fromhex(data))

    def test_values_as_json(self):
        wide = "variant<" + ",".join(["u8"] * 256) + ">"
        for text, data, expected in (
                (wide, "ff0007", {"index": 255, "value": 7}), ("vector<tuple<>>", "02000000", [[], []]), ("char", "0a", 10), ("char", "41", "A"),
                ("f32", struct.pack("<f", 2.1).hex(), 2.1), ("f64", struct.pack("<d", float("nan")).hex(), "NaN"), ("optional<optional<u8>>", "0100", [None]),
                ("array<char,4>", "49530000", "IS"), ("vector<byte>", "020000000102", "AQI="), ("map<u8,bool>", "010000000501", [[5, True]]),
                ("duration<i64,1/1000>", struct.pack("<q", -1500).hex(), -1.5), ("duration<i64,60/1>", struct.pack("<q", 7).hex(), "7 ticks"),
                ("time<i64,1/1000>", struct.pack("<q", 123).hex(), "1970-01-01T00:00:00.123Z"), ("enum:u8{a=1}", "02", 2), ("enum:u8{a=1}", "01", "a")):
            with self.subTest(text[:40]):
                of = schema.parse(text)
                self.assertEqual(to_json(of, decode(of, bytes.fromhex(data))), expected)


if __name__ == "__main__":
    unittest.main()
