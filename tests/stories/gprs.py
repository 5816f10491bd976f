"""The lines of components/gprs/README.md."""
import base64
import time


def line(content: str) -> bytes:
    """Framed, with its checksum."""
    total = 0
    for each in content.encode():
        total ^= each
    return f"${content}*{total:02X}\r\n".encode()


def login(boot: int, first_unacked: int = 1, last: int = 0, token: int = 1) -> bytes:
    return line(f"PATL,atirma,{boot},{first_unacked},{last},{token:016X}")


def record(boot: int, number: int, packet: bytes) -> bytes:
    return line(f"PATD,{boot},{number},{int(time.time())},L,{base64.b64encode(packet).decode()}")
