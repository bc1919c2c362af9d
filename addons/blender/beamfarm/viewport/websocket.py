"""A WebSocket client (RFC 6455) using only the standard library, for a server on this machine."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import os
import socket
import struct
import threading

_GUID = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
_CONTINUATION, _TEXT, _BINARY, _CLOSE, _PING, _PONG = 0x0, 0x1, 0x2, 0x8, 0x9, 0xA
# Limits in bytes on an answer's head, and on a message: more than a picture of 16384 x 16384 has is refused.
_MOST_HEAD = 1 << 16
_MOST = 1 << 31


class Closed(Exception):
    """The other side is gone, or sends nonsense."""


class WebSocket:
    """A connection. One thread may receive while others send."""

    def __init__(self, host: str, port: int, path: str, token: str, patience: float = 10.0) -> None:
        try:
            self._socket = socket.create_connection((host, port), timeout=patience)
        except OSError as error:
            raise Closed(f"no connection to {host}:{port}: {error}") from error
        self._sending = threading.Lock()
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._greet(f"{host}:{port}", path, token)
            self._socket.settimeout(None)
        except OSError as error:
            self._socket.close()
            raise Closed(f"{host}:{port}: {error}") from error
        except Closed:
            self._socket.close()
            raise

    def _greet(self, host: str, path: str, token: str) -> None:
        key = base64.b64encode(os.urandom(16)).decode()
        lines = (
            f"GET {path} HTTP/1.1",
            f"Host: {host}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key}",
            "Sec-WebSocket-Version: 13",
            f"Authorization: Bearer {token}",
        )
        self._socket.sendall("\r\n".join((*lines, "", "")).encode())
        head = b""
        # Byte by byte: what follows the head is the first message.
        while not head.endswith(b"\r\n\r\n"):
            byte = self._socket.recv(1)
            if not byte or len(head) > _MOST_HEAD:
                raise Closed("no answer")
            head += byte
        status, *fields = head.decode("latin-1").split("\r\n")
        if status.split(" ")[1:2] != ["101"]:
            raise Closed(status)
        named = dict(field.lower().split(": ", 1) for field in fields if ": " in field)
        accept = base64.b64encode(hashlib.sha1((key + _GUID).encode()).digest()).decode()
        if named.get("sec-websocket-accept") != accept.lower():
            raise Closed("the answer is not to this request")

    def send(self, text: str) -> None:
        """Sends a text message."""
        self._send(_TEXT, text.encode())

    def _send(self, kind: int, payload: bytes) -> None:
        size = len(payload)
        if size < 126:
            head = struct.pack("!BB", 0x80 | kind, 0x80 | size)
        elif size < 1 << 16:
            head = struct.pack("!BBH", 0x80 | kind, 0x80 | 126, size)
        else:
            head = struct.pack("!BBQ", 0x80 | kind, 0x80 | 127, size)
        # Clients must mask, although it hides nothing. These messages are short.
        mask = os.urandom(4)
        masked = bytes(byte ^ mask[place % 4] for place, byte in enumerate(payload))
        try:
            with self._sending:
                self._socket.sendall(head + mask + masked)
        except OSError as error:
            raise Closed(str(error)) from error

    def receive(self) -> str | bytearray:
        """The next message, text or binary; waits for it."""
        kind, parts = None, bytearray()
        while True:
            is_last, code, payload = self._frame(_MOST - len(parts))
            if code == _PING:
                self._send(_PONG, bytes(payload))
                continue
            if code == _PONG:
                continue
            if code == _CLOSE:
                raise Closed("closed by the other side")
            if (code == _CONTINUATION) == (kind is None):
                raise Closed("messages out of order")
            kind = code if kind is None else kind
            # Pictures come in one piece, and are not copied.
            parts = payload if not parts else parts + payload
            if is_last:
                return parts.decode("utf-8", "replace") if kind == _TEXT else parts

    def _frame(self, most: int) -> tuple[bool, int, bytearray]:
        first, second = self._exactly(2)
        if first & 0x70 or second & 0x80 or first & 0x0F not in (_CONTINUATION, _TEXT, _BINARY, _CLOSE, _PING, _PONG):
            raise Closed("no frame")
        size = second & 0x7F
        if size == 126:
            (size,) = struct.unpack("!H", self._exactly(2))
        elif size == 127:
            (size,) = struct.unpack("!Q", self._exactly(8))
        if size > most:
            raise Closed(f"a message of more than {most} bytes")
        return bool(first & 0x80), first & 0x0F, self._exactly(size)

    def _exactly(self, size: int) -> bytearray:
        data = bytearray(size)
        view, have = memoryview(data), 0
        while have < size:
            try:
                got = self._socket.recv_into(view[have:])
            except OSError as error:
                raise Closed(str(error)) from error
            if got == 0:
                raise Closed("gone")
            have += got
        return data

    def close(self) -> None:
        """Ends it, also for the receiving thread."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
