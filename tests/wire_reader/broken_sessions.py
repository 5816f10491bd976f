"""Hand-made sessions for the test of the checker: a good one, and one for every rule that a peer can break."""
import struct

import schema
from frames import FIRST_PIECE, HEADER, NUMBERS, REQUEST, SCHEME, control, encode_frame, prove

TEXT, NOTHING, OTHER = "struct{said:string}", "struct{}", "struct{said:string,more:u8}"
_prints = {text: schema.fingerprint(schema.parse(text)) for text in (TEXT, NOTHING, OTHER)}
TEXTS = {number: text for text, number in _prints.items()}
text_print, nothing_print, other_print = _prints.values()

Session = list[tuple[str, bytes | None]]


def I(*frames: bytes) -> Session:
    return [("initiator", frame) for frame in frames]


def R(*frames: bytes) -> Session:
    return [("responder", frame) for frame in frames]


def said(word: str) -> bytes:
    return struct.pack("<I", len(word)) + word.encode()


def hello(**fields) -> bytes:
    return control("hello", **{"self": {"incarnation": 5}, **fields})


def welcome(**fields) -> bytes:
    return control("welcome", **{"self": {"path": "boat", "incarnation": 9, "epoch": 4}, **fields})


def introduce(number: int = 0, prints=(text_print, text_print)) -> bytes:
    return control("introduce", number, service="helm", fingerprints=prints)


def request(id: int = 0, service: int = 0, left: int = 10**9, body: bytes = said("hold"), flags: int = 0) -> bytes:
    return encode_frame("request", id, REQUEST.pack(service, left) + body, flags)


def reply(id: int = 0, word: str = "held") -> bytes:
    return encode_frame("reply", id, said(word))


def error(id: int = 0, **fields) -> bytes:
    return control("error", id, **{"code": 1, "reason": "no", **fields})


def subscribe(id: int = 1, **fields) -> bytes:
    introduction = {"service": "fixes", "fingerprints": [nothing_print, text_print, text_print, text_print, text_print]}
    return control("subscribe", id, **{"service": introduction, **fields})


def subscribed(id: int = 1, ticket: int = 1, **fields) -> bytes:
    own = [nothing_print, text_print, text_print, text_print, text_print]
    return control("subscribed", id, **{"ticket": [ticket] * 16, "incarnation": 9, "first_sequence": 1, "fingerprints": own,
                                        "response": said("yes"), **fields})


def stamped(sequence: int, skipped: int | None = None, at: int = 1_500_000_000_000_000_000) -> bytes:
    head = struct.pack("<Q", sequence) if skipped is None else struct.pack("<QI", sequence, skipped)
    return encode_frame("packet", 1, head + struct.pack("<q", at) + said("fix"), 2 | (skipped is not None))


def caused(sequence: int, trace: int = 5, at: int = 1_500_000_000_000_000_000) -> bytes:
    return encode_frame("packet", 1, struct.pack("<QqQQQ", sequence, at, trace, 6, 7) + said("fix"), 2 | 4)


def packet(sequence: int, id: int = 1, skipped: int | None = None, body: bytes = said("fix")) -> bytes:
    if skipped is None:
        return encode_frame("packet", id, struct.pack("<Q", sequence) + body)
    return encode_frame("packet", id, struct.pack("<QI", sequence, skipped) + body, 1)


def credit(total: int, id: int = 1) -> bytes:
    return encode_frame("credit", id, struct.pack("<Q", total))


def first_piece(of: str | int, size: int, body: bytes, message: int = 0, id: int = 1, flags: int = 0) -> bytes:
    number = NUMBERS[of] if isinstance(of, str) else of
    return encode_frame("piece", id, FIRST_PIECE.pack(number, 0, message, size) + body, flags)


def piece(body: bytes, id: int = 1, flags: int = 0) -> bytes:
    return encode_frame("piece", id, body, flags)


def goodbye(**fields) -> bytes:
    return control("goodbye", **{"code": 6, "reason": "enough", **fields})


def ask(*prints: int) -> bytes:
    return control("schema_request", fingerprints=prints)


def show(print_: int, text: str) -> bytes:
    return control("schema", fingerprint=print_, text=text)


def resume(ticket: int = 7, incarnation: int = 9) -> dict:
    return {"resume": [{"ticket": [ticket] * 16, "incarnation": incarnation, "next_sequence": 11}]}


GREETED = I(hello()) + R(welcome())

KEY = b"k" * 64
OFFER = {"scheme": SCHEME, "proof": [1] * 32}
CHALLENGE = control("challenge", scheme=SCHEME, proof=[2] * 32)


def proof(sender: str, *before: bytes, **fields) -> bytes:
    """What proves KEY after these frames."""
    return control("proof", **{"scheme": SCHEME, "proof": list(prove(KEY, sender, b"".join(before))), **fields})


_offering = hello(authentication=OFFER)
_first_proof = proof("initiator", _offering, CHALLENGE)
_last_proof = proof("responder", _offering, CHALLENGE, _first_proof, welcome())
CHALLENGED = I(_offering) + R(CHALLENGE)
PROVED = CHALLENGED + I(_first_proof)


def keyed_session() -> Session:
    """Both sides prove the key; then a call."""
    return PROVED + R(welcome(), _last_proof) + I(introduce(), request()) + R(reply())


CALLED = GREETED + I(introduce(), request())
SUBSCRIBED = GREETED + I(subscribe()) + R(subscribed())
STAMPED = I(hello(features=39)) + R(welcome(features=39)) + I(subscribe(min_interval_ns=1)) + R(subscribed())


CAUSED = I(hello(features=167)) + R(welcome(features=167)) + I(subscribe(min_interval_ns=1)) + R(subscribed())
TRACED = I(hello(features=71)) + R(welcome(features=71))


def good_session() -> Session:
    """Does a bit of everything and breaks nothing."""
    whole = REQUEST.pack(0, 5) + said("x" * 50)
    calls = (I(introduce(), request()) + R(reply())
             + I(request(1 << 32), request(1, flags=1, body=struct.pack("<QQ", 3, 0) + said("hold"))) + R(error(1, code=8, execution=1))
             + I(encode_frame("cancel", 1 << 32), request(2 << 32)) + R(reply(1 << 32), reply(2 << 32))
             + I(introduce(1, (text_print, text_print)), request(3 << 32, 1))
             + R(control("answers", 1, fingerprints=[text_print, other_print]), encode_frame("reply", 3 << 32, said("a") + b"\1"))
             + R(control("answers", 1, fingerprints=[text_print, text_print])) + I(request(5 << 32, 1)) + R(reply(5 << 32)))  # provided anew
    pieces = (I(first_piece("request", len(whole), whole[:20], 4 << 32), encode_frame("ping", 77), piece(whole[20:40])) + R(encode_frame("pong", 0, flags=1), encode_frame("pong", 77))
              + I(first_piece("request", 900, b"", 9, id=2), piece(b"abc", id=2, flags=2), piece(whole[40:], flags=1)) + R(reply(4 << 32)))
    schemas = I(ask(text_print, 12345)) + R(show(text_print, TEXT), show(12345, ""), ask(other_print)) + I(show(other_print, OTHER))
    latest = I(subscribe()) + R(subscribed(), packet(1), packet(4), packet(5)) + I(encode_frame("unsubscribe", 1, said("done"))) + R(packet(6), encode_frame("unsubscribed", 1, said("bye")))
    lossless = (I(subscribe(2, policy=2, credit=2)) + R(subscribed(2, 2, first_sequence=9), packet(9, 2), packet(10, 2)) + I(credit(3, 2)) + R(packet(11, 2))
                + I(encode_frame("unsubscribe", 2)) + R(control("ended", 2, code=7, reason="late"), encode_frame("unsubscribed", 2)))
    limited = I(subscribe(3, min_interval_ns=5)) + R(subscribed(3, 3), packet(1, 3), packet(7, 3, skipped=4))
    resumed = I(subscribe(4, **resume())) + R(subscribed(4, 7, resumed=True, first_sequence=11, response=b""), packet(20, 4))
    refused = I(subscribe(5)) + R(control("ended", 5, code=1, reason="no"))
    return GREETED + calls + pieces + schemas + latest + lossless + limited + resumed + refused + I(goodbye(), None) + R(goodbye(), None)


BROKEN: dict[str, tuple[Session, str]] = {
    "type 0": (GREETED + I(encode_frame(0)), "the type is 1 to 127"),
    "type above 127": (GREETED + I(encode_frame(128)), "the type is 1 to 127"),
    "a reserved field": (GREETED + I(encode_frame("ping", reserved=1)), "the reserved field is 0"),
    "a long frame": (GREETED + R(HEADER.pack(1048577, 50, 0, 0, 0)), "at most 1048576 are accepted"),
    "a long hello": (I(HEADER.pack(16385, 1, 0, 0, 0)), "at most 16384 are accepted"),
    "not a hello first": (I(encode_frame("ping")), "the first frame of the initiator is hello"),
    "not a welcome first": (I(hello()) + R(encode_frame("ping")), "the first frame of the responder is welcome or reject"),
    "too early": (I(hello(), encode_frame("ping")) + R(welcome()), "sends nothing more before it has the welcome"),
    "two hellos": (GREETED + I(hello()), "one handshake"),
    "a hello of the wrong side": (GREETED + R(hello()), "only the initiator sends it"),
    "a welcome to nobody": (R(welcome()), "a welcome answers a hello"),
    "a reject to nobody": (R(control("reject", code=13)), "a reject answers a hello"),
    "a reject behind a welcome": (GREETED + R(control("reject", code=13)), "one handshake"),
    "on after a reject": (I(hello()) + R(control("reject", code=13), encode_frame("ping")), "nothing comes behind a reject"),
    "a hello with an id": (I(control("hello", 1, self={"incarnation": 5})), "its id is 0"),
    "a hello cut off": (I(encode_frame("hello", body=b"ISE1\1")), "no packet of hello"),
    "no incarnation": (I(hello(self={})), "an incarnation is not 0"),
    "too small frames": (I(hello(accepts={"max_frame_bytes": 1000})), "max_frame_bytes is at least"),
    "another scheme": (I(hello(authentication={"scheme": "secret"})), "its authentication is empty, or of the scheme"),
    "a short nonce": (I(hello(authentication={"scheme": SCHEME, "proof": [1] * 31})), "its authentication is empty, or of the scheme"),
    "bytes without a scheme": (I(hello(authentication={"proof": [1]})), "its authentication is empty, or of the scheme"),
    "a welcome that authenticates": (I(hello()) + R(welcome(authentication=OFFER)), "the authentication of a welcome is empty"),
    "a challenge to one who offers nothing": (I(hello()) + R(CHALLENGE), "a challenge answers a hello that offers a key, once"),
    "two challenges": (CHALLENGED + R(CHALLENGE), "a challenge answers a hello that offers a key, once"),
    "a challenge of another scheme": (I(_offering) + R(control("challenge", scheme="x", proof=[2] * 32)), "a challenge has the scheme"),
    "a challenge of the wrong side": (I(_offering, CHALLENGE), "only the responder sends it"),
    "a welcome in place of a challenge": (I(_offering) + R(welcome()), "the first frame of the responder is challenge or reject"),
    "a welcome before the proof": (CHALLENGED + R(welcome()), "a welcome comes behind the proof of the initiator"),
    "a proof that nobody asked for": (I(_offering, _first_proof), "a proof of the initiator answers a challenge, once"),
    "two proofs": (PROVED + I(_first_proof), "a proof of the initiator answers a challenge, once"),
    "a forged proof": (CHALLENGED + I(proof("initiator", b"something else")), "a proof is that of the key"),
    "a proof reflected": (PROVED + R(welcome(), _first_proof), "a proof is that of the key"),
    "half a proof": (CHALLENGED + I(proof("initiator", proof=[3] * 16)), "a proof has the scheme"),
    "a proof before the welcome": (PROVED + R(_last_proof), "a proof of the responder stands behind its welcome, once"),
    "no proof behind the welcome": (PROVED + R(welcome(), encode_frame("ping", 1)), "the proof of the responder stands behind its welcome"),
    "a proof in the session": (PROVED + R(welcome(), _last_proof, _last_proof), "a proof of the responder stands behind its welcome, once"),
    "a feature less": (I(hello(features=3)), "version 1 has the features 1, 2 and 4, not only 0x3"),
    "another magic": (I(hello(magic=5)), "magic is 0x31455349"),
    "no range": (I(hello(oldest=3, newest=2)), "oldest is not above newest"),
    "another version": (I(hello()) + R(welcome(version=2)), "version 2 is not in the range 1 to 1"),
    "another path": (I(hello(wanted_path="buoy")) + R(welcome()), "wanted_path is b'buoy'"),
    "another incarnation": (I(hello(wanted_incarnation=8)) + R(welcome()), "wanted_incarnation is 8"),
    "another epoch": (I(hello(wanted_epoch=3)) + R(welcome()), "wanted_epoch is 3"),
    "an unknown flag": (GREETED + I(encode_frame("ping", flags=1)), "flags 0x1 are not defined"),
    "a ping with a body": (GREETED + I(encode_frame("ping", body=b"x")), "it is empty"),
    "a pong with a body": (GREETED + I(encode_frame("ping", 3)) + R(encode_frame("pong", 3, b"x")), "it is empty"),
    "a pong without the clock that both said": (I(hello(features=23)) + R(welcome(features=23)) + I(encode_frame("ping", 3)) + R(encode_frame("pong", 3)),
                                                "it is the sender's clock"),
    "a pong that nobody asked for": (GREETED + R(encode_frame("pong", 9)), "the id of a ping that waits for it"),
    "a stalled pong that answers": (GREETED + I(encode_frame("ping", 3)) + R(encode_frame("pong", 3, flags=1)),
                                    "a stalled pong answers no ping"),
    "an unknown code": (GREETED + I(goodbye(code=26)), "code 26 is not in the list"),
    "on after goodbye": (GREETED + I(goodbye(), encode_frame("ping")), "nothing comes behind a goodbye"),
    "bytes after goodbye": (GREETED + I(goodbye() + b"\0\0\0"), "nothing comes behind a goodbye"),

    "a short first piece": (GREETED + I(piece(b"x" * 17)), "at least 18 bytes"),
    "a message too large": (GREETED + I(first_piece("request", 268435457, b"")), "at most 268435456 are accepted"),
    "a piece in pieces": (GREETED + I(first_piece("piece", 20, b"")), "no piece is inside pieces"),
    "type 0 in pieces": (GREETED + I(first_piece(0, 20, b"")), "the type in pieces is 1 to 127"),
    "65 messages": (GREETED + I(*(first_piece("request", 9, b"", id=n) for n in range(65))), "at most 64 messages"),
    "too much together": (I(hello()) + R(welcome(accepts={"max_message_bytes": 9})) + I(*(first_piece("request", 9, b"123456789", id=n) for n in range(3))),
                          "more than twice 9"),
    "more than announced": (GREETED + I(first_piece("request", 3, b"1234")), "4 bytes came of 3 announced"),
    "less than announced": (GREETED + I(first_piece("request", 3, b"12", flags=1)), "the last piece, but 2 bytes came of 3"),
    "goodbye in the middle": (GREETED + I(first_piece("request", 3, b"12"), goodbye()), "a message is half there"),

    "services that do not count": (GREETED + I(introduce(1)), "service numbers count: 0 is the next"),
    "too many services": (GREETED + I(*(introduce(n) for n in range(4097))), "at most 4096 services"),
    "a call service of five": (GREETED + I(introduce(prints=[1, 2, 3, 4, 5])), "two fingerprints"),
    "a short request": (GREETED + I(introduce(), encode_frame("request", 0, b"x" * 11)), "at least 12 bytes"),
    "a short traced request": (GREETED + I(introduce(), request(flags=1)), "at least 28 bytes"),
    "no trace": (GREETED + I(introduce(), request(flags=1, body=bytes(16) + said("x"))), "a traced request has a trace"),
    "wide without the feature": (GREETED + I(introduce(), request(flags=17, body=struct.pack("<QQQ", 3, 0, 4) + said("x"))), "wide is a flag of traced"),
    "wide without a trace": (TRACED + I(introduce(), request(flags=16)), "wide is a flag of traced"),
    "a wide trace without its upper half": (TRACED + I(introduce(), request(flags=17, body=bytes([3]) + bytes(23) + said("x"))), "upper half of a wide trace"),
    "a short wide request": (TRACED + I(introduce(), request(flags=17, body=bytes(23))), "at least 36 bytes"),
    "negative time": (GREETED + I(introduce(), request(left=-1)), "the time that is left is not negative"),
    "not introduced": (GREETED + I(request()), "service 0 was not introduced"),
    "a request that is none": (GREETED + I(introduce(), request(body=b"\5")), "the request is no struct"),
    "an id used again": (CALLED + R(reply()) + I(request()), "the id of a call is not used again"),
    "a slot too high": (GREETED + I(introduce(), request(1048576)), "slot 1048576 is not below"),
    "a slot in use": (CALLED + I(request(1 << 32)), "slot 0 is still used"),
    "a reply to nobody": (GREETED + R(reply()), "answers a request that came"),
    "a reply to what was abandoned": (GREETED + I(introduce(), first_piece("request", 90, b"", 0), piece(b"", flags=2)) + R(reply()), "answers a request that came"),
    "two replies": (CALLED + R(reply(), reply()), "a request is answered once"),
    "a reply and an error": (CALLED + R(reply(), error()), "a request is answered once"),
    "a reply that is none": (CALLED + R(encode_frame("reply", 0, b"\1")), "the reply is no struct"),
    "an execution of 2": (CALLED + R(error(execution=2)), "execution is 0 or 1"),
    "an error without a code": (CALLED + R(error(code=0)), "code 0 is not in the list"),
    "a cancel with a body": (CALLED + I(encode_frame("cancel", 0, b"x")), "it is empty"),
    "a cancel of nothing": (GREETED + I(encode_frame("cancel", 5)), "cancels a request that was written"),
    "answers for nobody": (GREETED + R(control("answers", 0, fingerprints=[1, 2])), "service 0 was not introduced"),
    "answers of one": (CALLED + R(control("answers", 0, fingerprints=[1])), "two fingerprints"),
    "a reply in the layout of before": (CALLED + R(control("answers", 0, fingerprints=[text_print, other_print]), reply()), "the reply is no struct"),

    "65 schemas": (GREETED + I(ask(*range(65))), "more than 64"),
    "a schema for nobody": (GREETED + R(show(text_print, TEXT)), "nobody asked for"),
    "a schema that is none": (GREETED + I(ask(1)) + R(show(1, "strukt<u8>")), "strukt is no type"),
    "a schema of another": (GREETED + I(ask(1)) + R(show(1, TEXT)), "the text hashes to"),
    "its own unknown": (CALLED + R(ask(text_print)) + I(show(text_print, "")), "is its own, and it does not know it"),
    "its own of a subscription unknown": (SUBSCRIBED + R(ask(text_print)) + I(show(text_print, "")), "is its own, and it does not know it"),

    "a subscription twice": (SUBSCRIBED + I(subscribe()), "the id of a subscription is not used again"),
    "a subscription of two": (GREETED + I(subscribe(service={"service": "x", "fingerprints": [1, 2]})), "five fingerprints"),
    "policy 4": (GREETED + I(subscribe(policy=4)), "there is no policy 4"),
    "two to resume": (GREETED + I(subscribe(resume=resume()["resume"] * 2)), "resume has none or one"),
    "too many subscriptions": (I(hello()) + R(welcome(accepts={"max_subscriptions": 1})) + I(subscribe(1), subscribe(2)), "2 subscriptions where the peer accepts 1"),
    "subscribed to nobody": (GREETED + R(subscribed()), "a subscription that was asked for"),
    "subscribed behind the end": (GREETED + I(subscribe()) + R(control("ended", 1, code=1), subscribed()), "the subscription is over"),
    "subscribed twice": (SUBSCRIBED + R(subscribed(ticket=2)), "a subscribe is answered once"),
    "subscribed of two": (GREETED + I(subscribe()) + R(subscribed(fingerprints=[1, 2])), "five fingerprints"),
    "sequence 0": (GREETED + I(subscribe()) + R(subscribed(first_sequence=0)), "numbered from 1"),
    "subscribed by another": (GREETED + I(subscribe()) + R(subscribed(incarnation=8)), "the incarnation is that of the handshake"),
    "a zero ticket": (GREETED + I(subscribe()) + R(subscribed(ticket=0)), "random, not zero"),
    "resumed unasked": (GREETED + I(subscribe()) + R(subscribed(resumed=True, response=b"")), "nobody asked to resume"),
    "resumed over a restart": (GREETED + I(subscribe(**resume(incarnation=8))) + R(subscribed(ticket=7, resumed=True, response=b"")), "another incarnation"),
    "another ticket": (GREETED + I(subscribe(**resume())) + R(subscribed(ticket=6, resumed=True, response=b"")), "keeps its ticket"),
    "answered again": (GREETED + I(subscribe(**resume())) + R(subscribed(ticket=7, resumed=True)), "its response is empty"),
    "no fresh ticket": (GREETED + I(subscribe(**resume())) + R(subscribed(ticket=7)), "a fresh ticket"),
    "a ticket twice": (SUBSCRIBED + I(subscribe(2)) + R(subscribed(2)), "a ticket is given once"),
    "a response that is none": (GREETED + I(subscribe()) + R(subscribed(response=b"\1")), "the subscribed packet is no struct"),
    "a short packet": (SUBSCRIBED + R(encode_frame("packet", 1, b"x" * 7)), "at least 8 bytes"),
    "a packet before the answer": (GREETED + I(subscribe()) + R(packet(1)), "the answer precedes the first packet"),
    "a short stamped packet": (STAMPED + R(encode_frame("packet", 1, b"x" * 15, 2)), "at least 16 bytes"),
    "a packet without its time": (STAMPED + R(packet(1)), "both sides tell times of publication, and it has none"),
    "a time that nobody understands": (SUBSCRIBED + R(stamped(1)), "flags 0x2 are not defined"),
    "a short traced packet": (CAUSED + R(encode_frame("packet", 1, b"x" * 39, 6)), "at least 40 bytes"),
    "a traced packet without a trace": (CAUSED + R(caused(1, trace=0)), "a traced packet has a trace"),
    "a trace that nobody understands": (STAMPED + R(caused(1)), "flags 0x6 are not defined"),
    "backwards": (SUBSCRIBED + R(packet(2), packet(2)), "sequence 2 is below the expected 3"),
    "too many skipped": (GREETED + I(subscribe(min_interval_ns=1)) + R(subscribed(), packet(2, skipped=2)), "2 skipped of 1"),
    "lossless that loses": (GREETED + I(subscribe(policy=2, credit=9)) + R(subscribed(), packet(2)), "policy 2 loses nothing"),
    "disconnect that loses": (GREETED + I(subscribe(policy=3)) + R(subscribed(), packet(2)), "policy 3 loses nothing"),
    "beyond the credit": (GREETED + I(subscribe(policy=2, credit=1)) + R(subscribed(), packet(1), packet(2)), "number 2 where 1 are granted"),
    "a packet that is none": (SUBSCRIBED + R(packet(1, body=b"")), "the packet is no struct"),
    "a packet behind the end": (SUBSCRIBED + R(control("ended", 1, code=1), packet(1)), "the subscription is over"),
    "a short credit": (SUBSCRIBED + I(encode_frame("credit", 1, b"x")), "a credit has 8 bytes"),
    "a credit for nothing": (GREETED + I(credit(1)), "a subscription that was asked for"),
    "a credit taken back": (GREETED + I(subscribe(policy=2, credit=5), credit(4)), "takes back what was granted"),
    "unsubscribed twice": (SUBSCRIBED + I(encode_frame("unsubscribe", 1), encode_frame("unsubscribe", 1)), "it was said before"),
    "unsubscribed by two": (SUBSCRIBED + I(encode_frame("unsubscribe", 1)) + R(*[encode_frame("unsubscribed", 1)] * 2), "an unsubscribe is answered once"),
    "ended behind unsubscribed": (SUBSCRIBED + I(encode_frame("unsubscribe", 1)) + R(encode_frame("unsubscribed", 1), control("ended", 1, code=1)), "the subscription is over"),
    "unsubscribed unasked": (SUBSCRIBED + R(encode_frame("unsubscribed", 1)), "it answers an unsubscribe"),
    "a farewell that is none": (SUBSCRIBED + I(encode_frame("unsubscribe", 1, b"\1")), "the unsubscribe packet is no struct"),
}

NOTED: dict[str, tuple[Session, str]] = {
    "an unknown type": (GREETED + I(encode_frame(99, 5, b"later", 3)), "passed over"),
    "nothing to abandon": (GREETED + I(piece(b"", 5, flags=2)), "nothing of this message came"),
    "a field more": (GREETED + I(encode_frame("goodbye", body=b"\6\0\0\0\0more")), "4 bytes behind the last field"),
    "a field less": (GREETED + I(encode_frame("goodbye", body=b"\6")), "has no field reason"),
    "cancelled twice": (CALLED + I(encode_frame("cancel"), encode_frame("cancel")), "was cancelled before"),
    "answers twice": (CALLED + R(*[control("answers", 0, fingerprints=[1, 2])] * 2), "or told before"),
    "needless answers": (CALLED + R(control("answers", 0, fingerprints=[text_print, text_print])), "the one that was introduced"),
    "0 skipped": (GREETED + I(subscribe(min_interval_ns=1)) + R(subscribed(), packet(1, skipped=0)), "0 were skipped"),
    "a time before 1970": (STAMPED + R(stamped(1), stamped(4, skipped=2, at=-1)), "it was published before 1970"),
    "needless credit": (SUBSCRIBED + I(credit(5)), "only lossless needs credit"),
    "late credit": (GREETED + I(subscribe(policy=2), encode_frame("unsubscribe", 1), credit(5)), "behind unsubscribe"),
}
