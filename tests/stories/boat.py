"""The packets of components/boat/README.md."""
import struct
import time


def crc16(raw: bytes) -> int:
    made = 0xFFFF
    for each in raw:
        made ^= each << 8
        for _ in range(8):
            made = (made << 1 ^ 0x1021 if made & 0x8000 else made << 1) & 0xFFFF
    return made


def packet(type_: int, boot: int, sequence: int, body: bytes) -> bytes:
    """With the time of now and the checksum."""
    now = int(time.time() * 1000)
    raw = struct.pack("<BBHIIH", 1, type_, boot, sequence, now & 0xFFFFFFFF, now >> 32) + body
    return raw + struct.pack("<H", crc16(raw))
