#!/usr/bin/env python3
"""What a farm's distant worker gets done while others knock: `python3 tests/knocking.py target/release/beamfarm`.

A worker whose answers take 0.15 s renders for 20 s: undisturbed, while 2,000 connections a second come from another
address and send nothing, and while they come from its own address. Prints the passes of each. Linux: addresses of
127.0.0.0/8.
"""

import asyncio
import json
import pathlib
import secrets
import socket
import subprocess
import sys
import tempfile
import threading
import time

DELAY = 0.075
SECONDS = 20
RATE = 2000
HELD = 8000
FAR = "127.0.0.3"
SCENE = """
image = { width = 64, height = 48 }
render = { paths = 20000, media = "photons", surfaces = "photons", caustics = "photons", targeting = "off" }
world = { medium = "fog" }
camera = { origin = [0, 1, 3], target = [0, 1, 0], fov = 50 }
media.fog = { type = "homogeneous", sigma_a = 0.1, sigma_s = 0.4 }
shapes = [{ type = "sphere", center = [0, 1, 0], radius = 0.35 }]
lights = [{ type = "point", position = [0.5, 2, 0.5], power = 100 }]
"""


def knock(source: str, port: int, end: threading.Event) -> int:
    """Opens connections and holds them until told to end; returns how many."""
    begun, held, count = time.monotonic(), [], 0
    while not end.is_set():
        while count < (time.monotonic() - begun) * RATE:
            door = socket.socket()
            door.setblocking(False)
            door.bind((source, 0))
            door.connect_ex(("127.0.0.1", port))
            held.append(door)
            count += 1
            if len(held) > HELD:
                held.pop(0).close()
        time.sleep(0.002)
    return count


async def carry(reader, writer) -> None:
    """Passes bytes from one to the other, each after the delay."""
    queue: asyncio.Queue = asyncio.Queue()

    async def deliver() -> None:
        while True:
            when, data = await queue.get()
            await asyncio.sleep(max(0.0, when - time.monotonic()))
            if not data:
                writer.close()
                return
            writer.write(data)

    delivery = asyncio.create_task(deliver())
    data = b"-"
    while data:
        try:
            data = await reader.read(1 << 16)
        except OSError:
            data = b""
        await queue.put((time.monotonic() + DELAY, data))
    await delivery


async def long_way(port: int, told: list) -> None:
    async def meet(reader, writer) -> None:
        await asyncio.sleep(2 * DELAY)
        try:
            there, back = await asyncio.open_connection("127.0.0.1", port, local_addr=(FAR, 0))
        except OSError:
            writer.close()
            return
        await asyncio.gather(carry(reader, back), carry(there, writer))

    server = await asyncio.start_server(meet, "127.0.0.1", 0)
    told.append(server.sockets[0].getsockname()[1])
    await server.serve_forever()


def passes(program: str, folder: pathlib.Path, source: str | None) -> tuple[int, int]:
    """Passes by the distant worker, and how many knocks there were."""
    (folder / "scene.toml").write_text(SCENE)
    (folder / "token").write_text(secrets.token_hex(32))
    serve = [program, "serve", "scene.toml", "--passes", "1000000", "--listen", "127.0.0.1:0", "--token-file", "token"]
    quiet = {"cwd": folder, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(serve, stdout=subprocess.PIPE, text=True, **quiet) as coordinator:
        url = coordinator.stdout.readline().split()[-1]
        port, told = int(url.rsplit(":", 1)[1]), []
        threading.Thread(target=lambda: asyncio.run(long_way(port, told)), daemon=True).start()
        end, knocks = threading.Event(), [0]

        def flood() -> None:
            knocks[0] = knock(source, port, end)

        flooding = threading.Thread(target=flood)
        if source:
            flooding.start()
        time.sleep(2)
        worker = [program, "worker", "--connect", f"http://127.0.0.1:{told[0]}", "--token-file", "token"]
        worker += ["--threads", "1", "--patience", "60s", "--state", "state", "--no-cache"]
        with subprocess.Popen(worker, stdout=subprocess.DEVNULL, **quiet) as far:
            time.sleep(SECONDS)
            status = [program, "status", url, "--token-file", "token", "--json"]
            done = json.loads(subprocess.run(status, capture_output=True, check=True, cwd=folder).stdout)["passes"]
            far.kill()
        coordinator.kill()
        end.set()
        if source:
            flooding.join()
    return done, knocks[0]


def main() -> None:
    program = str(pathlib.Path(sys.argv[1]).resolve())
    for what, source in [("undisturbed", None), ("knocks from elsewhere", "127.0.0.2"), ("from its own address", FAR)]:
        with tempfile.TemporaryDirectory() as folder:
            done, knocks = passes(program, pathlib.Path(folder), source)
        print(f"{what}: {done} passes in {SECONDS} s, {knocks / (SECONDS + 2):.0f} knocks a second", flush=True)


if __name__ == "__main__":
    main()
