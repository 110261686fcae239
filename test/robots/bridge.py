"""A bridge that is none: it speaks the websocket and lies to its client, and its own record is what the judge
believes. (No library: those refuse to send what a client has to survive.)

bridge.py PORT FOLDER hostile COUNT: COUNT hostile frames, each of which the client has to name or count.
bridge.py PORT FOLDER flood RATE SECONDS: messages at that rate, and a pulse every 20 ms.
bridge.py PORT FOLDER answer: for any number of clients, each of which is answered at once.

It is the child of its first client, whose memory it reads. FOLDER/lies has a line of JSON for each thing that happened;
FOLDER/record what became of goals, as that of the action servers (actions.py).
"""

import base64
import hashlib
import json
import os
import queue
import random
import socket
import struct
import sys
import threading
import time

PORT, FOLDER, MODE, ARGUMENTS = int(sys.argv[1]), sys.argv[2], sys.argv[3], sys.argv[4:]
TEXT, BINARY, PING, PONG = 1, 2, 9, 10

clock = time.monotonic
lies = open(FOLDER + "/lies", "a", buffering=1)
record = open(FOLDER + "/record", "ab", buffering=0)
writing = threading.Lock()


def note(**what):
    with writing:
        lies.write(json.dumps({"mode": MODE, "at": clock(), **what}) + "\n")


def note_goal(order, event):
    record.write(f"{clock():.6f} /fake {order} {event}\n".encode())


class Client:
    """The connection. What the client has sent is in queues: what it published (and when it came), and its goals."""

    def __init__(self, listening):
        self.socket, _ = listening.accept()
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.lock = threading.Lock()
        self.subscribed, self.said, self.goals = set(), queue.Queue(), queue.Queue()
        head = b""
        while b"\r\n\r\n" not in head:
            part = self.socket.recv(4096)
            if not part:
                raise ConnectionError("a client that left before it had asked for the websocket")
            head += part
        key = next(line for line in head.split(b"\r\n") if line.lower().startswith(b"sec-websocket-key:"))
        accept = hashlib.sha1(key.split(b":")[1].strip() + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest()
        self.socket.sendall(b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                            b"Sec-WebSocket-Accept: " + base64.b64encode(accept) + b"\r\n\r\n")
        threading.Thread(target=self.listen, daemon=True).start()

    def send(self, data):
        with self.lock:
            self.socket.sendall(data)

    def listen(self):
        stream = self.socket.makefile("rb")
        while head := stream.read(2):
            kind, length = head[0] & 15, head[1] & 127
            if length > 125:
                length = int.from_bytes(stream.read(2 if length == 126 else 8), "big")
            mask, payload = stream.read(4), stream.read(length)
            payload = bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))
            if kind == PING:
                self.send(frame(payload, PONG))
            elif kind == TEXT:
                self.take(json.loads(payload), clock())
        note(event="closed")

    def take(self, request, at):
        if request["op"] == "subscribe":
            self.subscribed.add(request["topic"])
        elif request["op"] == "publish":
            self.said.put((at, request["msg"]["data"]))
        elif request["op"] == "send_action_goal":
            note_goal(request["args"]["order"], "accepted")
            self.goals.put((request["id"], request["args"]["order"]))

    def await_topics(self, *names):
        while not self.subscribed.issuperset(names):
            time.sleep(0.01)

    def end_goal(self, name, order):
        note_goal(order, "succeeded")
        self.send(frame(text(op="action_result", id=name, status=4, result=True, values={"sequence": [order]})))


def frame(payload, kind=TEXT):
    length = len(payload)
    size = bytes([length]) if length < 126 else struct.pack(">BH", 126, length) if length < 65536 else (
        struct.pack(">BQ", 127, length))
    return bytes([128 | kind]) + size + payload


def text(**fields):
    return json.dumps(fields).encode()


def message(topic, data):
    return text(op="publish", topic=topic, msg={"data": data})


def memory():
    """What the client's memory is, in bytes."""
    with open(f"/proc/{os.getppid()}/statm") as pages:
        return int(pages.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def watch_memory():
    """Notes the most of each tenth of a second, and by how much a sleep of 2 ms was late then."""
    begun = clock()
    while True:
        most = late = 0
        before = begun
        while before < begun + 0.1:
            time.sleep(0.002)
            now = clock()
            late, before = max(late, now - before - 0.002), now
            most = max(most, memory())
        note(event="memory", begun=begun, ended=before, most=most, late=late)
        begun = before


# --- hostile frames -----------------------------------------------------------

MIB = 1048576
draw = random.Random(1)
good = message("/readings", 0.5)
goal = []  # the name that the client has given to its goal, and the goal's order


def torn():
    return good[:draw.randrange(1, len(good))]


def garbage():
    return draw.randbytes(draw.randrange(200))


def with_wrong_type():
    """A frame of rosbridge, in which one field has a type that it must not have."""
    frames = [
        (dict(op="publish", topic="/readings", msg={"data": 0.5}), ["op", "topic"]),
        (dict(op="action_result", id=goal[0], status=4, values={}, result=True), ["op", "id", "status"]),
        (dict(op="action_feedback", id=goal[0], values={}), ["op", "id"]),
        (dict(op="service_response", id="call 1", values={}, result=True), ["op", "id", "result"]),
    ]
    fields, wrong = draw.choice(frames)
    value = draw.choice([None, 1.5, -1, [], {}, [[]], {"op": "publish"}, 1e300])
    return text(**{**fields, draw.choice(wrong): value})


def with_wrong_status():
    return text(op="action_result", id=goal[0], status=draw.choice([-1, 1, 2, 3, 7, 99, "4", "succeeded"]), values={},
                result=True)


def without_field():
    return draw.choice([text(op="publish", topic="/readings"), text(op="publish", msg={"data": 0.5}), text(msg={}),
                        text(op="action_result", id=goal[0]), text(op="service_response", id="call 1")])


def of_another():
    """An answer to what was never asked."""
    n = draw.randrange(1000, 10**9)
    return draw.choice([
        text(op="action_result", id=f"goal {n}", status=4, values={"sequence": [n]}, result=True),
        text(op="action_result", id=str(n), status=5, values={"sequence": [n]}, result=False),
        text(op="action_feedback", id=f"goal {n}", values={"sequence": [n]}),
        text(op="service_response", id=f"call {n}", values={}, result=True),
        message(f"/nowhere{n}", n),
        text(op="surprise", id=goal[0]),
    ])


def complaint():
    return text(op="status", level="error", msg=draw.choice(["no\nsuch\r\nthing\0", "x" * 100000, "\n" * 1000]))


def nested():
    n = draw.randrange(65, 5000)
    opening, closing = draw.choice([(b"[", b"]"), (b'{"a":', b"}")])
    depth = opening * n + b"0" + closing * draw.choice([0, n])
    return b'{"op":"publish","topic":"/readings","msg":{"data":' + depth + b"}}"


def number(*literals):
    return lambda: b'{"op":"publish","topic":"/readings","msg":{"data":' + draw.choice(literals) + b"}}"


def always(payload):
    return lambda: payload


# Each kind: how many of 10,000 there are, what makes a frame, and what the client has to say of it: a line, or that it
# has judged a reading.
LINE, NOT_MEASURED, UNDECODABLE, FALSE, TRUE = "line", "NotMeasured", "Undecodable", "False", "True"
KINDS = {
    "torn JSON": (1500, torn, LINE),
    "garbage": (800, garbage, LINE),
    "no object": (300, lambda: draw.choice([b"", b"[]", b"5", b'"publish"', b"null", b"{}", b"true"]), LINE),
    "wrong types": (1500, with_wrong_type, LINE),
    "wrong statuses": (300, with_wrong_status, LINE),
    "a field missing": (500, without_field, LINE),
    "wrong ids": (1500, of_another, LINE),
    "complaints": (200, complaint, LINE),
    "nested deeply": (400, nested, LINE),
    "too many digits": (100, number(b"9" * 5000, b"0." + b"1" * 5000), LINE),
    "1 MiB of [": (50, always(b"[" * (MIB - 1)), LINE),
    "16 MiB of [": (40, always(b"[" * 16 * MIB), LINE),
    "16 MiB of {},": (10, always(b"{}," * (16 * MIB // 3)), LINE),
    "NaN, as no JSON has it": (400, number(b"NaN", b"Infinity", b"-Infinity", b"nan", b"+1", b".5", b"0x1"), LINE),
    "null": (800, number(b"null"), NOT_MEASURED),
    "no number": (800, number(b'"0.5"', b"[0.5]", b"true", b"{}", b'"NaN"', b'"\\u0000"'), UNDECODABLE),
    "huge numbers": (300, number(b"1e999", b"1e1000000000", b"9" * 1000), FALSE),
    "good, and low": (240, number(b"0.05", b"-1e999999999", b"1e-999999999", b"0"), TRUE),
    "good": (260, number(b"0.5", b"0.75", b"1"), FALSE),
}
# Not too large, and full of the smallest values.
ALLOWED = (10, lambda: draw.choice([b"[" + b"{}," * (MIB // 3 - 10) + b"{}]", b"[" + b"0," * (MIB // 2 - 10) + b"0]"]),
           LINE)


def send_one(client, kind, await_answer):
    _, make, wanted = KINDS.get(kind, ALLOWED)
    client.send(frame(make(), BINARY if kind == "garbage" else TEXT))
    sent, heard, answer = clock(), None, None
    if await_answer:
        try:
            heard, answer = client.said.get(timeout=5)
        except queue.Empty:
            pass
    note(event="frame", kind=kind, sent=sent, heard=heard, answer=answer, wanted=wanted, alone=await_answer)


def await_silence(client):
    try:
        while True:
            client.said.get(timeout=0.5)
    except queue.Empty:
        pass


def hostile(client, count):
    client.await_topics("/readings")
    goal[:] = client.goals.get()
    # The client's memory before is that of one which has had a thousand good messages.
    for _ in range(1000):
        client.send(frame(good))
        client.said.get()
    watching = threading.Thread(target=watch_memory, daemon=True)
    watching.start()
    time.sleep(0.5)
    kinds = [kind for kind, (n, _, _) in KINDS.items() for _ in range(n * count // 10000)]
    draw.shuffle(kinds)
    # The last tenth comes at once, the others each when the one before was answered.
    one_by_one = len(kinds) * 9 // 10
    note(event="begin")
    for kind in kinds[:one_by_one]:
        send_one(client, kind, await_answer=True)
    for kind in kinds[one_by_one:]:
        send_one(client, kind, await_answer=False)
    await_silence(client)
    note(event="end")
    client.end_goal(*goal)
    # What is not too large is parsed; what that costs is only told, but it must not cost the connection.
    goal[:] = client.goals.get()
    client.await_topics("/map")
    for _ in range(ALLOWED[0]):
        send_one(client, "allowed", await_answer=True)
    client.send(frame(message("/map", [0] * 3000000)))
    client.end_goal(*goal)


# --- floods ---------------------------------------------------------------------


def flood(client, rate, seconds):
    client.await_topics("/flood", "/pulse", "/over")
    threading.Thread(target=watch_memory, daemon=True).start()
    number, beats, begun = 0, [], clock()
    note(event="begin")
    while number < rate * seconds:
        due = min(int(rate * seconds), int((clock() - begun) * rate))
        parts = []
        while number < due:
            number += 1
            parts.append(frame(message("/flood", number)))
            if number % (rate // 50) == rate // 100:
                beats.append(clock())
                parts.append(frame(message("/pulse", len(beats))))
        client.send(b"".join(parts))
        time.sleep(0.001)
    note(event="end", sent=number, took=clock() - begun)
    # A signal shows the latest: a reaction to a later pulse is one to those before it, too.
    heard = 0
    while heard < len(beats):
        at, said = client.said.get()
        for pulse in range(heard, int(said)):
            note(event="reaction", took=at - beats[pulse])
        heard = int(said)
    note(event="all pulses were heard")
    client.send(frame(message("/over", number)))


# --- answers ----------------------------------------------------------------------


class Answered(Client):
    """One whose goals end at once when it cancels them, or when their order is 0; which receives what it publishes; and
    the time, on a topic."""

    def take(self, request, at):
        if request["op"] == "send_action_goal" and request["args"]["order"] == 0:
            self.send(frame(result(request["id"], 4)))
        elif request["op"] == "cancel_action_goal":
            self.send(frame(result(request["id"], 5)))
        elif request["op"] == "publish":
            self.send(frame(message("/heard", request["msg"]["data"])))
        elif request["op"] == "subscribe" and request["topic"] == "/time":
            threading.Thread(target=self.tell_the_time, daemon=True).start()

    def tell_the_time(self):
        try:
            while True:
                time.sleep(0.002)
                self.send(frame(message("/time", clock())))
        except OSError:
            pass  # it is no longer there


def result(name, status):
    return text(op="action_result", action="/any", id=name, status=status, result=status == 4,
                values={"sequence": [0]})


listening = socket.create_server(("127.0.0.1", PORT))
while MODE == "answer":
    Answered(listening)
client = Client(listening)
note(event="connected")
if MODE == "hostile":
    hostile(client, int(ARGUMENTS[0]))
else:
    flood(client, int(ARGUMENTS[0]), float(ARGUMENTS[1]))
while True:
    # A client that connects again has lost the link.
    listening.accept()
    note(event="connected")
