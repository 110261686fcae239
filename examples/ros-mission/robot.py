"""The robot of ros-mission: a simulated one (pyrobosim), as action servers and a battery.

robot.py RECORD [--seed N]: a hall with a charger, a room behind it, a front door (1) and a back door (2). The actions
have the type test_msgs/Fibonacci, whose order is the number of the door. It does one thing at a time, and rejects
other goals meanwhile. The service /new_mission puts it back into the hall; with --seed the doors' state, and when the
battery falls low, are then drawn at random.

The record is the robot's own: a line for each event, with the time (CLOCK_MONOTONIC, in seconds), the action with its
door, the number of the goal, and what happened.
"""

import argparse
import itertools
import random
import threading
import time

import rclpy
from pyrobosim.core import Robot, World
from pyrobosim.navigation.execution import ConstantVelocityExecutor
from pyrobosim.navigation.world_graph import WorldGraphPlanner
from pyrobosim.planning.actions import TaskAction
from pyrobosim.utils.general import get_data_folder
from pyrobosim.utils.pose import Pose
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from sensor_msgs.msg import BatteryState
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci

options = argparse.ArgumentParser()
options.add_argument("record")
options.add_argument("--seed", type=int)
options = options.parse_args()
record = open(options.record, "ab", buffering=0)
PACE = 10  # seconds of the robot in one of the wall
DOORS = {1: "front_door", 2: "back_door"}


def note(what, number, event):
    record.write(f"{time.monotonic():.6f} {what} {number} {event}\n".encode())


def box(y):
    return {"type": "polygon", "coords": [(0, y), (4, y), (4, y + 2), (0, y + 2)]}


world = World()
world.set_metadata(locations=[get_data_folder() / f"example_location_data_{name}.yaml"
                              for name in ("furniture", "accessories")])
world.add_room(name="hall", footprint=box(0), nav_poses=[Pose(x=2, y=1)])
world.add_room(name="room", footprint=box(3), nav_poses=[Pose(x=2, y=4)])
for door, x in (("front_door", 1), ("back_door", 3)):
    world.add_hallway(name=door, room_start="hall", room_end="room", width=0.8, conn_method="points",
                      conn_points=[(x, 1), (x, 4)], is_open=False)
world.add_location(name="charger", category="charger", parent="hall", pose=Pose(x=2, y=0.4), is_charger=True)
world.add_location(name="desk", category="desk", parent="room", pose=Pose(x=2, y=4.5))
robot = Robot(name="robot", radius=0.1, path_planner=WorldGraphPlanner(), path_executor=ConstantVelocityExecutor())
world.add_robot(robot, loc="hall", pose=Pose(x=2, y=1))


# What it can do: steps, each of which says whether it has succeeded.
def do(kind, place=None):
    def step():
        robot.reset_path_planner()
        return robot.execute_action(TaskAction(type=kind, target_location=place), realtime_factor=PACE).is_success()
    return step


def unlock(door):
    return lambda: world.unlock_location(door).is_success()


def is_open(door):
    return lambda: world.get_hallway_by_name(door).is_open


ACTIONS = {
    "open": lambda door: [do("navigate", door), do("open")],
    "pass_through": lambda door: [is_open(door), do("navigate", "room")],
    "close": lambda door: [do("navigate", door), do("close")],
    "smash": lambda door: [do("navigate", door), unlock(door), do("open")],
    "recharge": lambda door: [do("navigate", "charger")],
    "do_task": lambda door: [do("navigate", "desk"), do("detect"), do("navigate", "room"), do("navigate", "desk")],
}

# Goals. There is at most one.
lock, numbers, doing = threading.Lock(), itertools.count(1), None


def new_goal(what, request):
    global doing
    with lock:
        number = next(numbers)
        name = f"{what}{request.order or ''}"
        if doing:
            note(name, number, "rejected")
            return GoalResponse.REJECT
        doing = name, number
        note(name, number, "accepted")
        while falls:
            timers.append(threading.Timer(falls.pop(), fall))
            timers[-1].start()
        return GoalResponse.ACCEPT


def cancel(goal):
    with lock:
        # (The goal may have ended since the cancel came.)
        if doing:
            note(*doing, "cancel")
    return CancelResponse.ACCEPT


def work(what, goal):
    global doing
    steps, well = ACTIONS[what](DOORS.get(goal.request.order)), []
    thread = threading.Thread(
        target=lambda: well.append(all(not goal.is_cancel_requested and step() for step in steps)))
    thread.start()
    while thread.is_alive():
        # (Again and again: pyrobosim forgets a cancel that comes while it plans the path.)
        robot.path_executor.cancel_execution = goal.is_cancel_requested
        thread.join(0.01)
    event = "succeeded" if any(well) else "canceled" if goal.is_cancel_requested else "aborted"
    {"succeeded": goal.succeed, "canceled": goal.canceled, "aborted": goal.abort}[event]()
    with lock:
        note(*doing, event)
        doing = None
    return Fibonacci.Result()


# Missions, and the battery: how many seconds after a mission's first goal it falls low.
draw, missions, falls, timers = random.Random(options.seed), itertools.count(1), [], []


def charges():
    return robot.location.name.startswith("charger")


def fall():
    if not charges():
        robot.battery_level = 5.0
        note("battery", 0, "low")


def publish_battery():
    # (pyrobosim charges only on arrival.)
    if charges():
        robot.battery_level = 100.0
    publisher.publish(BatteryState(percentage=robot.battery_level / 100))


def new_mission(request=None, response=None):
    mission, random_day = next(missions), options.seed is not None
    for timer in timers:
        timer.cancel()
    timers.clear()
    robot.set_pose(Pose(x=2, y=1))
    robot.location, robot.battery_level = world.get_room_by_name("hall"), 100.0
    for door in world.hallways:
        world.unlock_location(door)
        world.close_location(door)
        if draw.random() < 0.5 if random_day else door.name == "front_door":
            world.lock_location(door)
    # (Two thirds of the missions are interrupted, some of them twice.)
    falls[:] = [draw.uniform(0, 2) for _ in range(draw.choice([0, 1, 1, 1, 2, 2]))] if random_day else [0.8]
    locked = "_and_".join(door.name for door in world.hallways if door.is_locked) or "none"
    note("mission", mission, f"begins:locked_{locked}")
    if response:
        response.success, response.message = doing is None, locked
    return response


rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
node = rclpy.create_node("robot")
publisher = node.create_publisher(BatteryState, "/battery_state", 10)
node.create_timer(0.05, publish_battery)
group = ReentrantCallbackGroup()
servers = [
    ActionServer(node, Fibonacci, f"/{what}", lambda goal, what=what: work(what, goal), callback_group=group,
                 goal_callback=lambda request, what=what: new_goal(what, request), cancel_callback=cancel)
    for what in ACTIONS
]
# (After the actions: a program that reaches it reaches them, too.)
node.create_service(Trigger, "/new_mission", new_mission)
executor = MultiThreadedExecutor(num_threads=8)
executor.add_node(node)
new_mission()
note("robot", 0, "ready")
executor.spin()
