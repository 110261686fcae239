"""A door: it has a record of its own, and refuses a robot whose fence is smaller than one it has seen.

door.py SOCKET RECORD   (the socket has that name when the door listens)
"""

import os
import socket
import sys
import threading
import time

path, record = sys.argv[1], open(sys.argv[2], "a", buffering=1)
greatest = 0
lock = threading.Lock()


def serve(client):
    global greatest
    with client:
        words = client.makefile().readline().split()
        if len(words) != 3:
            return
        what, name, fence = words[0], words[1], int(words[2])
        with lock:
            accepted = fence >= greatest
            greatest = max(greatest, fence)
            record.write(f"{time.monotonic():.6f} {what} {name} {fence} {'accepted' if accepted else 'refused'}\n")
        try:
            client.sendall(b"accepted" if accepted else b"refused")
        except OSError:
            pass  # it was killed


server = socket.socket(socket.AF_UNIX)
server.bind(f"{path}.new")
os.chmod(f"{path}.new", 0o777)
server.listen(64)
os.rename(f"{path}.new", path)
while True:
    threading.Thread(target=serve, args=(server.accept()[0],), daemon=True).start()
