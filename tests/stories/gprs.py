"""The lines of components/gprs/README.md."""


def line(content: str) -> bytes:
    """Framed, with its checksum."""
    total = 0
    for each in content.encode():
        total ^= each
    return f"${content}*{total:02X}\r\n".encode()
