"""The robot (test/Browser.hs), and its own record."""

import json
import os
import subprocess

from watching import whole_lines

FOLDER = os.environ["BROWSER"]
ports = iter(range(8500, 9500, 10))


class Robot:
    """A run of it: its process, its port, and its own record."""

    def __init__(self, *arguments, port=None, recorded=True, first=""):
        self.port = port or next(ports)
        self.file = f"{FOLDER}/{self.port}.trace"
        if os.path.exists(self.file):
            os.remove(self.file) # of another robot
        mode, *others = map(str, arguments)
        more = [self.file] if recorded else []
        self.process = subprocess.Popen([FOLDER + "/robot", mode, str(self.port), *more, *others], text=True,
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.says = self.process.stderr.readline() # where its page is
        if first:
            self.tell(first)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate()

    @property
    def address(self):
        return f"http://127.0.0.1:{self.port}/"

    def tell(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def end(self):
        """Its run ends: gives what it has printed."""
        printed, _ = self.process.communicate("\n")
        return printed

    def recorded(self):
        """Its record so far: the events, without the header."""
        if not os.path.exists(self.file):
            return []
        return [json.loads(line) for line in whole_lines(self.file)[1:]]

    def cpu(self):
        """How many seconds it has worked."""
        with open(f"/proc/{self.process.pid}/stat") as file:
            return sum(map(int, file.read().rsplit(")", 1)[1].split()[11:13])) / os.sysconf("SC_CLK_TCK")

    def memory(self):
        """How many bytes of it are in memory, at most until now."""
        with open(f"/proc/{self.process.pid}/status") as file:
            return next(int(line.split()[1]) * 1024 for line in file if line.startswith("VmHWM"))


def running(events):
    """The events "began" of the spans that run after these, by their numbers."""
    begun = {}
    for event in events:
        if event["event"] == "began":
            begun[event["number"]] = event
        elif event["event"] == "ended":
            begun.pop(event["number"], None)
    return [begun[number] for number in sorted(begun)]


def names_running(events):
    return [event["name"] for event in running(events) if event["kind"] == "named"]
