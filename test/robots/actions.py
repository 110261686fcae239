"""An action server, whose own record is what the judge believes.

Each goal has an order of its own, which identifies it. A goal lasts as long as --lasts says,
publishes feedback every 0.1 s (the bridge loses some of what comes right after the acceptance, for other clients, too),
and looks every --period whether it is to be cancelled. The record has one line for each event of a goal: the time
(CLOCK_MONOTONIC, in seconds), the order, what happened.
"""

import argparse
import time

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

options = argparse.ArgumentParser()
options.add_argument("name")
options.add_argument("record")
options.add_argument("--period", type=float, default=0.01, help="how often a goal looks whether it is to be cancelled")
options.add_argument("--lasts", type=float, default=10, help="how many seconds a goal takes")
options.add_argument("--never-confirms", action="store_true", help="it accepts a cancel, and goes on to its end")
options.add_argument("--rejects", type=int, default=0, help="orders that this divides are rejected")
options.add_argument("--aborts", type=int, default=0, help="orders that this divides are aborted at their end")
options = options.parse_args()

# (One write for each line, at its end: several servers append to one file.)
record = open(options.record, "ab", buffering=0)


def note(order, event):
    record.write(f"{time.monotonic():.6f} {options.name} {order} {event}\n".encode())


def divides(number, order):
    return number > 0 and order % number == 0


def new_goal(request):
    if divides(options.rejects, request.order):
        note(request.order, "rejected")
        return GoalResponse.REJECT
    note(request.order, "accepted")
    return GoalResponse.ACCEPT


def cancel(goal):
    note(goal.request.order, "cancel")
    return CancelResponse.ACCEPT


def work(goal):
    order = goal.request.order
    result = Fibonacci.Result(sequence=[order])
    ends = time.monotonic() + options.lasts
    published = 0
    while time.monotonic() < ends:
        if time.monotonic() >= published + 0.1:
            goal.publish_feedback(Fibonacci.Feedback(sequence=[order]))
            published = time.monotonic()
        time.sleep(min(options.period, max(0, ends - time.monotonic())))
        if goal.is_cancel_requested and not options.never_confirms:
            note(order, "canceled")
            goal.canceled()
            return result
    if divides(options.aborts, order):
        note(order, "aborted")
        goal.abort()
    else:
        note(order, "succeeded")
        goal.succeed()
    return result


rclpy.init()
node = Node("actions" + options.name.replace("/", "_"))
server = ActionServer(node, Fibonacci, options.name, work, goal_callback=new_goal, cancel_callback=cancel)
note(0, "ready")
executor = MultiThreadedExecutor(num_threads=16)
executor.add_node(node)
executor.spin()
