#!/usr/bin/env python3
"""What `ssh -L` does for an instantiation server that listens on loopback only: tunnel.py ADDRESS PORT carries what comes to
ADDRESS:PORT on to 127.0.0.1:PORT. Says "carries" when it listens; ends by a signal."""
import asyncio
import sys

ADDRESS, PORT = sys.argv[1], int(sys.argv[2])


async def pump(reader, writer):
    try:
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()
    except OSError:
        pass
    finally:
        writer.close()


async def carry(reader, writer):
    try:
        there, back = await asyncio.open_connection("127.0.0.1", PORT)
    except OSError:
        writer.close()
        return
    await asyncio.gather(pump(reader, back), pump(there, writer))


async def main():
    server = await asyncio.start_server(carry, ADDRESS, PORT)
    print("carries", flush=True)
    async with server:
        await server.serve_forever()


asyncio.run(main())
