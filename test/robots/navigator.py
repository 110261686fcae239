"""An action server with the type and the manners of Nav2's: navigator.py NAME RECORD.

A goal's x is its order, and its y how many seconds it takes. It is rejected if its frame is not "map", and aborted at
its end if its behaviour tree is "blocked". A new goal replaces the one before, which is aborted. The record is as that
of actions.py; there are also what came and what was answered, in JSON.
"""

import json
import math
import sys
import threading
import time

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from nav2_msgs.action import NavigateToPose

NAME = sys.argv[1]
record = open(sys.argv[2], "ab", buffering=0)
newest, lock = None, threading.Lock()


def note(order, event):
    record.write(f"{time.monotonic():.6f} {NAME} {order} {event}\n".encode())


def order_of(request):
    return round(request.pose.pose.position.x)


def numbers(pose):
    at, turned = pose.pose.position, pose.pose.orientation
    return [at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w]


def new_goal(request):
    came = [request.pose.header.frame_id, numbers(request.pose), request.behavior_tree]
    note(order_of(request), "goal:" + json.dumps(came, separators=(",", ":")))
    accepted = request.pose.header.frame_id == "map"
    note(order_of(request), "accepted" if accepted else "rejected")
    return GoalResponse.ACCEPT if accepted else GoalResponse.REJECT


def begin(goal):
    global newest
    with lock:
        newest = goal
    goal.execute()


def cancel(goal):
    note(order_of(goal.request), "cancel")
    return CancelResponse.ACCEPT


def drive(goal):
    order, lasts = order_of(goal.request), goal.request.pose.pose.position.y
    begun, tick = time.monotonic(), 0
    while time.monotonic() < begun + lasts:
        tick += 1
        answer(goal, order, tick)
        time.sleep(0.02)
        if goal.is_cancel_requested:
            return end(order, "canceled", goal.canceled, 0, "")
        if goal is not newest:
            return end(order, "aborted", goal.abort, 1, "replaced")
    if goal.request.behavior_tree == "blocked":
        return end(order, "aborted", goal.abort, 2, f"no way to {order}")
    return end(order, "succeeded", goal.succeed, 0, str(order))


def answer(goal, order, tick):
    """Each has other values. (The first has no distance yet: it is not a number.)"""
    feedback = NavigateToPose.Feedback(current_pose=goal.request.pose, number_of_recoveries=tick - 2,
                                       distance_remaining=math.nan if tick == 1 else tick / 4)
    feedback.navigation_time.sec, feedback.navigation_time.nanosec = tick, 250_000_000
    feedback.estimated_time_remaining.sec = -tick
    note(order, f"feedback:{tick}")
    goal.publish_feedback(feedback)


def end(order, event, how, code, why):
    note(order, event)
    how()
    return NavigateToPose.Result(error_code=code, error_msg=why)


rclpy.init()
node = Node("navigator")
server = ActionServer(node, NavigateToPose, NAME, drive, goal_callback=new_goal, handle_accepted_callback=begin,
                      cancel_callback=cancel)
note(0, "ready")
executor = MultiThreadedExecutor(num_threads=8)
executor.add_node(node)
executor.spin()
