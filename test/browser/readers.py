"""Readers of a robot's page that are no browser, and what the system knows of their connections."""

import base64
import contextlib
import functools
import http.server
import json
import os
import socket
import struct
import threading
import time

import websockets.sync.client


def ask(port, headers, path="/"):
    """The status and the text of the answer to a request with these headers only."""
    lines = [f"GET {path} HTTP/1.1", *(f"{name}: {value}" for name, value in headers),
             "Connection: " + ("Upgrade" if path == "/live" else "close"), "", ""]
    with socket.create_connection(("127.0.0.1", port), 5) as connection:
        connection.settimeout(5)
        connection.sendall("\r\n".join(lines).encode())
        answer = connection.recv(65536)
    return int(answer.split()[1]), answer.decode("utf-8", "replace")


def upgrade(host, origin=None):
    """The headers of a request for the websocket."""
    key = base64.b64encode(os.urandom(16)).decode()
    headers = [("Host", host), ("Upgrade", "websocket"), ("Sec-WebSocket-Version", "13"), ("Sec-WebSocket-Key", key)]
    return headers + ([("Origin", origin)] if origin is not None else [])


@contextlib.contextmanager
def reading(port, **attach):
    """The messages that a reader receives."""
    place = f"127.0.0.1:{port}"
    with websockets.sync.client.connect(f"ws://{place}/live", origin=f"http://{place}", max_size=None) as connection:
        connection.send(json.dumps({"version": 1, **attach}))
        yield map(json.loads, connection)


class Tunnel(contextlib.AbstractContextManager):
    """Another port, at which everything is passed on to that one: as ssh -L does."""

    def __init__(self, to):
        self.to, self.frozen = to, set()
        self.listening = socket.create_server(("127.0.0.1", 0))
        self.port = self.listening.getsockname()[1]
        self.open = set()
        threading.Thread(target=self.accept, daemon=True).start()

    def __exit__(self, *_):
        self.listening.close()

    def freeze(self):
        """Of the connections that there are, no byte is passed on any more, nor their end."""
        self.frozen = set(self.open)

    def accept(self):
        with contextlib.suppress(OSError):
            while True:
                here, _ = self.listening.accept()
                try:
                    there = socket.create_connection(("127.0.0.1", self.to))
                except OSError: # nothing is there
                    here.close()
                    continue
                self.open.add(here)
                for ends in ((here, there), (there, here)):
                    threading.Thread(target=self.carry, args=(here, *ends), daemon=True).start()

    def carry(self, connection, one, other):
        with contextlib.suppress(OSError):
            while part := one.recv(65536):
                if connection not in self.frozen:
                    other.sendall(part)
        if connection not in self.frozen:
            for end in (one, other):
                with contextlib.suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)


@contextlib.contextmanager
def serving(folder):
    """The address at which the files of the folder are served."""
    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def connections(port):
    """The robot's ends of connections, by the port of the other end: whether each is established, and how many bytes
    wait to be taken by the other end. (What the kernel says.)"""
    with open("/proc/net/tcp") as file:
        rows = [line.split() for line in file][1:]
    return {int(row[2].split(":")[1], 16): (row[3] == "01", int(row[4].split(":")[0], 16))
            for row in rows if int(row[1].split(":")[1], 16) == port}


class Silent:
    """A reader that attaches, and never reads. (What it says after that are these bytes: the first ones once, and the
    others again and again.)"""

    def __init__(self, port, once=b"", more=b""):
        self.port, self.waiting, self.ended, self.missed = port, 0, None, None
        self.more, self.begun = more, time.monotonic()
        self.stalled = self.begun
        self.socket = socket.socket()
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self.socket.connect(("127.0.0.1", port))
        place = f"127.0.0.1:{port}"
        lines = ["GET /live HTTP/1.1", *(f"{n}: {v}" for n, v in upgrade(place, f"http://{place}")),
                 "Connection: Upgrade", "", ""]
        self.socket.sendall("\r\n".join(lines).encode())
        attach = b'{"version":1}'
        mask = os.urandom(4)
        self.socket.sendall(struct.pack("BB", 0x81, 0x80 | len(attach)) + mask
                            + bytes(b ^ mask[i % 4] for i, b in enumerate(attach)) + once)

    def watched(self, known):
        """Looks at its connection: whether it has ended, which it has when two looks in turn do not find it: the kernel
        may leave one out that is there. (Stalled: the robot's bytes are taken no more.)"""
        is_there, waiting = known.get(self.socket.getsockname()[1], (False, 0))
        if self.more and self.ended is None:
            with contextlib.suppress(OSError):
                self.socket.sendall(self.more)
        if is_there:
            self.missed = None
            if waiting != self.waiting:
                self.waiting, self.stalled = waiting, time.monotonic()
        elif self.missed is None:
            self.missed = time.monotonic()
        elif self.ended is None:
            self.ended = self.missed
        return self.ended is not None
