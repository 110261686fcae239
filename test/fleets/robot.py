"""A robot in Python, by the functions of the schema alone (src/fleet-schema/schema-1.sql).

robot.py ADDRESS robot NAME TERM                   carries orders
robot.py ADDRESS visitor NAME RESOURCE DOOR RATE   passes through the door at that socket, again and again; its own
                                                   clock runs at that rate
"""

import json
import select
import socket
import sys
import time
import uuid

import psycopg2
import psycopg2.extensions

ANSWER_WITHIN = 2
deadline = float("inf")


def wait(connection):
    """How psycopg2 waits for the server: until the deadline."""
    while True:
        state = connection.poll()
        if state == psycopg2.extensions.POLL_OK:
            return
        left = deadline - time.monotonic()
        fd = connection.fileno()
        reads = state == psycopg2.extensions.POLL_READ
        if left <= 0 or not any(select.select([fd] if reads else [], [] if reads else [fd], [], left)):
            raise psycopg2.OperationalError("no answer in time")


psycopg2.extensions.set_wait_callback(wait)


class Fleet:
    """One connection, which comes back."""

    def __init__(self, address, name):
        self.address, self.name, self.connection = address, name, None

    def ask(self, text, values, within=ANSWER_WITHIN, before=None):
        """The rows of a statement, in one transaction with the statement before it."""
        global deadline
        deadline = time.monotonic() + within
        try:
            if self.connection is None:
                self.connection = psycopg2.connect(self.address)
                with self.connection.cursor() as cursor:
                    cursor.execute("listen fleet; commit")
            with self.connection, self.connection.cursor() as cursor:
                if before:
                    cursor.execute(*before)
                cursor.execute(text, values)
                return cursor.fetchall()
        except (psycopg2.OperationalError, psycopg2.InterfaceError) as why:
            self.leave()
            raise ConnectionError from why

    def leave(self):
        """The connection is of no use any more."""
        connection, self.connection = self.connection, None
        if connection is not None:
            connection.close()

    def rest(self, seconds, *notices, line=None):
        """Until there is one of these notices, and at most that long. (After that of the line 0.25 s more, and at most
        3 s.)"""
        begun = time.monotonic()
        ends = begun + seconds
        if self.connection is None:
            time.sleep(min(0.1, seconds))
        while self.connection is not None and time.monotonic() < ends:
            came = {it.payload for it in self.connection.notifies}
            self.connection.notifies.clear()
            if came.intersection(notices):
                break
            if line in came:
                ends = min(begun + 3, time.monotonic() + 0.25)
            select.select([self.connection], [], [], max(0, ends - time.monotonic()))
            try:
                self.connection.poll()
            except psycopg2.Error:
                self.leave()


def carry_orders(fleet, term):
    is_answered = True
    while True:
        try:
            # (What was asked, and not answered, is asked again: it may have started a task.)
            request, is_again = str(uuid.uuid4()) if is_answered else request, not is_answered
            is_answered = False
            found = fleet.ask("select task, lease, input from fleet.claim('orders', %s, '{}', %s * interval '1 s', "
                              "%s, %s)", ([fleet.name], term, request, is_again))
            is_answered = True
            if not found:
                fleet.rest(1, "queue orders")
                continue
            task, lease, (order, seconds) = found[0]
            # (Without a row the lease is lost; and the row says whether the task is cancelled.)
            renewed = [(False,)]
            ends = time.monotonic() + seconds
            while renewed == [(False,)] and time.monotonic() < ends:
                time.sleep(min(term / 3, max(0, ends - time.monotonic())))
                if time.monotonic() < ends:
                    renewed = fleet.ask("select is_cancelled from fleet.renew(%s, %s)", ([task], [lease]))
            if renewed == [(True,)]:
                fleet.ask("select fleet.fail(%s, %s, 'cancelled')", (task, lease))
            elif renewed:
                fleet.ask("select fleet.complete(%s, %s, %s)", (task, lease, json.dumps(None)),
                          before=("insert into delivered (n, robot) values (%s, %s)", (order, fleet.name)))
        except ConnectionError:
            fleet.rest(0.1)
        except psycopg2.Error as refused:
            if refused.pgcode != "FL001":
                raise


def pass_door(fleet, resource, door, clock):
    """Once. It holds the door for a term, asks to keep it at each third, and is out at two thirds."""
    term = 1
    request = str(uuid.uuid4())

    def says(what):
        with socket.socket(socket.AF_UNIX) as it:
            it.connect(door)
            it.sendall(f"{what} {fleet.name} {fence}\n".encode())
            return it.recv(16) == b"accepted"

    fence = None
    while fence is None:
        asked = clock()
        try:
            [(fences, again)] = fleet.ask("select fences, again_in from fleet.hold(%s, %s, %s, %s * interval '1 s')",
                                          (request, [resource], fleet.name, term))
            if fences:
                fence = fences[0]
            else:
                fleet.rest(max(0.005, min(again, 3)), f"turn {request}", f"resource {resource}",
                           line=f"line {resource}")
        except ConnectionError:
            fleet.rest(0.1)
    begun, stays = clock(), 1.2 if fence % 8 == 0 else 0.02
    is_held = clock() < asked + 2 / 3 * term
    if is_held:
        says("enter")
    while is_held and clock() < begun + stays:
        time.sleep(max(0, min(begun + stays, asked + term / 3) - clock()))
        if clock() >= asked + term / 3:
            now = clock()
            try:
                is_held = fleet.ask("select fleet.keep(%s::uuid[])", ([request],), within=asked + 2 / 3 * term - now)
                asked = now
            except ConnectionError:
                is_held = clock() < asked + 2 / 3 * term
    says("leave")
    try:
        fleet.ask("select fleet.release(%s)", (request,))
    except ConnectionError:
        pass  # it ends by itself


def main():
    address, mode, name, *others = sys.argv[1:]
    fleet = Fleet(address, name)
    if mode == "robot":
        carry_orders(fleet, float(others[0]))
    else:
        resource, door, rate = others
        while True:
            pass_door(fleet, resource, door, lambda: float(rate) * time.clock_gettime(time.CLOCK_BOOTTIME))


main()
