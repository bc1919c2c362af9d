"""A process of `beamfarm live`, and its messages. Nothing here depends on Blender."""

from __future__ import annotations

import contextlib
import json
import os
import re
import struct
import subprocess
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from queue import Queue

import numpy as np

from ..program import hidden
from .websocket import Closed, WebSocket

_PAGE = re.compile(r"page: http://(\S+?):(\d+)/enter#(\S+)")
_LOOK = "/look?pixels=linear"
# The error of a scene that no GPU can render any more.
_NOT_FOR_DEVICES = "the engine gpu cannot render"
# Seconds for the process to end without being killed.
_GRACE = 5.0


@dataclass(frozen=True)
class Frame:
    """A picture of a scene's state."""

    number: int
    seq: int
    """The last change that it includes."""
    passes: int
    """The number of averaged passes; 0 for a sketch."""
    of: int
    pixels: np.ndarray
    """Linear radiance, (height, width, 3), the first row at the top."""


@dataclass(frozen=True)
class State:
    """The current activity."""

    doing: str = "sketch"
    passes: int = 0
    of: int = 0
    error: float | None = None


def parse_frame(data: bytearray) -> Frame:
    """Parses a binary message: the length of a JSON header, the header, and R, G, B of each pixel as 32-bit floats."""
    (size,) = struct.unpack_from("<I", data)
    header = json.loads(bytes(data[4 : 4 + size]))
    width, height = int(header["width"]), int(header["height"])
    have = len(data) - 4 - size
    if have != 12 * width * height:
        raise ValueError(f"{have} bytes for {width} x {height} pixels")
    # The header may have any length, so the floats start at any byte.
    pixels = np.frombuffer(data, "<f4", offset=4 + size).reshape(height, width, 3)
    numbers = (int(header[name]) for name in ("frame", "seq", "passes", "of"))
    return Frame(*numbers, pixels)


class Live:
    """A live view of a scene file. `news` is called, from another thread, whenever there is something to show."""

    def __init__(self, program: Path, scene: Path, options: list[str], news: Callable[[], None]) -> None:
        self._news = news
        self._lock = threading.Lock()
        self._frame: Frame | None = None
        self._state = State()
        self._trouble: str | None = None
        self._seq = 0
        self._socket: WebSocket | None = None
        self._unsent: list[str] = []
        self._closing = False
        self._is_refused = False
        # Tokens and certificates of farms: a view makes its own token and prints that of its page.
        of_farms = ("BEAMFARM_T", "BEAMFARM_OPERATOR_T")
        environment = {name: value for name, value in os.environ.items() if not name.startswith(of_farms)}
        self._process = subprocess.Popen(
            [str(program), "live", str(scene), "--quiet", "--with-parent", *options],
            # Closing this ends the process.
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
            env=environment,
            **hidden(),
        )
        self._said: deque[str] = deque(maxlen=5)
        self._address: Queue[tuple[str, int, str] | None] = Queue()
        self._listener = threading.Thread(target=self._listen, name="beamfarm live: log", daemon=True)
        self._thread = threading.Thread(target=self._run, name="beamfarm live", daemon=True)
        self._listener.start()
        self._thread.start()

    @property
    def frame(self) -> Frame | None:
        """The newest picture."""
        with self._lock:
            return self._frame

    @property
    def state(self) -> State:
        """The current activity."""
        with self._lock:
            return self._state

    @property
    def trouble(self) -> str | None:
        """What is wrong with the scene, or with the process."""
        with self._lock:
            return self._trouble

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come."""
        return not self._thread.is_alive()

    @property
    def is_refused(self) -> bool:
        """Whether it ended before it had a page, or its engine no longer accepts the scene."""
        with self._lock:
            return self._is_refused or _NOT_FOR_DEVICES in (self._trouble or "")

    def change(self, kind: str, **fields: object) -> int:
        """Sends a change of the scene. Returns its number, which pictures that include it carry."""
        with self._lock:
            self._seq += 1
            seq = self._seq
        self.tell(kind, seq=seq, **fields)
        return seq

    def tell(self, kind: str, **fields: object) -> None:
        """Sends another message; messages wait until there is a connection."""
        text = json.dumps({"type": kind, **fields})
        with self._lock:
            if self._socket is None:
                self._unsent.append(text)
                return
            socket = self._socket
        # If it is closed, the receiving thread notices as well.
        with contextlib.suppress(Closed):
            socket.send(text)

    def close(self) -> None:
        """Ends the process."""
        self._closing = True
        with self._lock:
            socket = self._socket
        if socket is not None:
            socket.close()
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(_GRACE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._thread.join(_GRACE)
        self._listener.join(_GRACE)

    def _run(self) -> None:
        wrong = []
        try:
            address = self._address.get()
            if address is None:
                with self._lock:
                    self._is_refused = True
            else:
                host, port, token = address
                self._receive(WebSocket(host, port, _LOOK, token))
        except Closed as error:
            wrong.append(str(error))
        finally:
            if not self._closing:
                lines = [line.removeprefix("error: ") for line in self._said if line.strip()]
                self._be_in_trouble("\n".join(lines or wrong) or "beamfarm live has ended")

    def _listen(self) -> None:
        """Reads its standard error to the end, so that it never has to wait."""
        with self._process.stderr as stream:
            for line in stream:
                page = _PAGE.match(line)
                if page:
                    self._address.put((page[1], int(page[2]), page[3]))
                else:
                    self._said.append(line.rstrip())
        # It never got as far as a page.
        self._address.put(None)

    def _receive(self, socket: WebSocket) -> None:
        with self._lock:
            self._socket, unsent = socket, self._unsent
            self._unsent = []
        for text in unsent:
            socket.send(text)
        while not self._closing:
            message = socket.receive()
            try:
                self._hear(message)
            except (ValueError, KeyError, TypeError, struct.error) as error:
                self._be_in_trouble(f"beamfarm live sent what is not understood: {error}")

    def _hear(self, message: str | bytearray) -> None:
        if isinstance(message, bytearray):
            frame = parse_frame(message)
            with self._lock:
                self._frame = frame
            # The next one may come: only the newest is shown.
            self.tell("drawn", frame=frame.number)
            self._news()
            return
        told = json.loads(message)
        if told["type"] == "error":
            self._be_in_trouble(str(told["message"]))
        elif told["type"] == "fine":
            self._be_in_trouble(None)
        elif told["type"] == "state":
            state = State(str(told["doing"]), int(told["passes"]), int(told["of"]), told["error"])
            with self._lock:
                self._state = state
            self._news()

    def _be_in_trouble(self, message: str | None) -> None:
        with self._lock:
            self._trouble = message
        self._news()
