"""Packets as LAYOUT.md lays them out: bytes to plain values by a schema, and values to JSON."""
import base64
import datetime
import math
import struct
from dataclasses import dataclass, field
from typing import Any

from schema import Type

FORMATS = {"char": "<B", "byte": "<B", "i8": "<b", "u8": "<B", "i16": "<h", "u16": "<H", "i32": "<i", "u32": "<I",
           "i64": "<q", "u64": "<Q", "f32": "<f", "f64": "<d"}
EMPTY_ELEMENTS = 65536  # of elements that take no byte, beyond the bytes that are left


class Malformed(ValueError):
    """Bytes that are no such packet; says where."""


@dataclass
class Decoder:
    """Takes values from `data`, one behind the other."""

    data: bytes
    at: int = 0
    empties: int = field(default=-1)

    def fail(self, what: str):
        raise Malformed(f"at byte {self.at} of the packet: {what}")

    def take(self, count: int) -> bytes:
        if count > len(self.data) - self.at:
            self.fail(f"{count} bytes are needed and {len(self.data) - self.at} are left")
        self.at += count
        return self.data[self.at - count : self.at]

    def number(self, kind: str):
        form = struct.Struct(FORMATS[kind])
        return form.unpack(self.take(form.size))[0]

    def count(self, least: int) -> int:
        count = self.number("u32")
        left = len(self.data) - self.at
        if least and count * least > left:
            self.fail(f"{count} elements of at least {least} bytes are announced and {left} bytes are left")
        if not least:
            self.empties = (left + EMPTY_ELEMENTS if self.empties < 0 else self.empties) - count
            if self.empties < 0:
                self.fail("too many elements that take no byte")
        return count

    def flag(self, what: str) -> bool:
        value = self.number("u8")
        if value > 1:
            self.at -= 1
            self.fail(f"{what} is 0 or 1, not {value}")
        return bool(value)

    def value(self, of: Type) -> Any:
        """A value: numbers, bool, bytes (strings too), lists, dicts of structs, ("index", value) of variants."""
        match of.kind:
            case "bool":
                return self.flag("a bool")
            case "enum":
                return self.number(of.integer)
            case "string" | "opaque":
                return self.take(self.count(1))
            case "duration" | "time":
                return self.number(of.integer)
            case "vector":
                return self.elements(of.inner[0], self.count(of.inner[0].min_bytes()))
            case "array":
                return self.elements(of.inner[0], of.count)
            case "set":
                keys = set()
                return [self.key(of.inner[0], keys) for _ in range(self.count(of.inner[0].min_bytes()))]
            case "map":
                keys = set()
                least = of.inner[0].min_bytes() + of.inner[1].min_bytes()
                return [(self.key(of.inner[0], keys), self.value(of.inner[1])) for _ in range(self.count(least))]
            case "optional":
                return [self.value(of.inner[0])] if self.flag("the first byte of an optional") else None
            case "variant":
                index = self.number("u8" if of.index_bytes() == 1 else "u16")
                if index >= len(of.inner):
                    self.fail(f"alternative {index} of {len(of.inner)}")
                return index, self.value(of.inner[index])
            case "tuple":
                return [self.value(each) for each in of.inner]
            case "struct":
                return {name: self.value(each) for name, each in zip(of.names, of.inner)}
            case _:
                return self.number(of.kind)

    def elements(self, of: Type, count: int) -> Any:
        if of.kind in ("byte", "char", "u8"):
            return self.take(count)
        return [self.value(of) for _ in range(count)]

    def key(self, of: Type, known: set) -> Any:
        begin = self.at
        out = self.value(of)
        if self.data[begin : self.at] in known:
            self.fail("a key comes twice")
        known.add(self.data[begin : self.at])
        return out


def decode(of: Type, data: bytes) -> Any:
    """One packet, all of its bytes. Throws Malformed."""
    reader = Decoder(data)
    out = reader.value(of)
    if reader.at != len(data):
        reader.fail(f"{len(data) - reader.at} bytes are left over")
    return out


def to_json(of: Type, value: Any) -> Any:
    """The JSON value that LAYOUT.md gives for a decoded value."""
    match of.kind:
        case "f32" | "f64":
            return _real(value, of.kind)
        case "char":
            return chr(value) if 0x20 <= value < 0x7F else value
        case "byte" | "bool" | "string":
            return value.decode("utf-8", "replace") if of.kind == "string" else value
        case "enum":
            return of.names[of.values.index(value)] if value in of.values else value
        case "opaque":
            return base64.b64encode(value).decode()
        case "vector" | "array" | "set":
            return _list(of, value)
        case "tuple":
            return [to_json(each, item) for each, item in zip(of.inner, value)]
        case "map":
            pairs = [(to_json(of.inner[0], key), to_json(of.inner[1], item)) for key, item in value]
            return dict(pairs) if of.inner[0].kind == "string" else [list(pair) for pair in pairs]
        case "optional":
            if value is None:
                return None
            inner = to_json(of.inner[0], value[0])
            return [inner] if of.inner[0].kind == "optional" else inner
        case "variant":
            return {"index": value[0], "value": to_json(of.inner[value[0]], value[1])}
        case "struct":
            return {name: to_json(each, value[name]) for name, each in zip(of.names, of.inner)}
        case "duration":
            return _duration(of, value)
        case "time":
            return _time(of, value)
        case _:
            return value


def _real(value: float, kind: str) -> Any:
    if math.isnan(value):
        return "NaN"
    if math.isinf(value):
        return "Infinity" if value > 0 else "-Infinity"
    if kind == "f32":  # the shortest number that is this one again
        for digits in range(1, 10):
            short = float(f"{value:.{digits}g}")
            if struct.pack("<f", short) == struct.pack("<f", value):
                return short
    return value


def _list(of: Type, value: Any) -> Any:
    kind = of.inner[0].kind
    if kind == "byte" and of.kind != "set":
        return base64.b64encode(value).decode()
    if kind == "char" and of.kind != "set":
        try:
            return (value.rstrip(b"\0") if of.kind == "array" else value).decode("utf-8")
        except UnicodeDecodeError:
            return list(value)
    return [to_json(of.inner[0], item) for item in value]


def _duration(of: Type, value: Any) -> Any:
    up, down = of.period
    if not _power_of_ten(up, down):
        return f"{value} ticks"
    if of.integer == "f64":
        return _real(value * up / down, "f64")
    return value * up / down if abs(value) <= 1 << 53 else _decimal(value * up, down)


def _time(of: Type, value: Any) -> Any:
    up, down = of.period
    if of.integer == "f64" or not _power_of_ten(up, down):
        return f"{value} ticks"
    seconds, rest = divmod(value * up, down)
    try:
        day = datetime.datetime(1970, 1, 1) + datetime.timedelta(seconds=seconds)
    except OverflowError:
        return f"{value} ticks"
    digits = len(str(down)) - 1
    return day.strftime("%Y-%m-%dT%H:%M:%S") + (f".{rest:0{digits}}" if digits else "") + "Z"


def _power_of_ten(up: int, down: int) -> bool:
    return str(up).strip("0") == "1" and str(down).strip("0") == "1"


def _decimal(value: int, down: int) -> str:
    digits = len(str(down)) - 1
    sign, value = "-" if value < 0 else "", abs(value)
    return f"{sign}{value // down}" + (f".{value % down:0{digits}}" if digits else "")
