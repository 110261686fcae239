"""How a judge waits for other processes, and reads what they are still writing."""

import time


def until(condition, seconds, what="it", step=0.01):
    """What the condition gives first that is true; to wait for longer than that is a fault of the test's."""
    ends = time.monotonic() + seconds
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > ends:
            raise TimeoutError(f"{what} did not come within {seconds} s")
        time.sleep(step)


def whole_lines(file):
    """The lines that are whole by now. (One reading, in bytes: a file that is read line by line gives the part of a
    line that is there, and then, if more has come, the other part as a line; and a part may end within a character.)"""
    with open(file, "rb") as content:
        return [line.decode("utf-8", "replace") for line in content.read().split(b"\n")[:-1]]
