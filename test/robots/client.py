"""Another client (roslibpy), for comparison: how long a message there and back takes, a goal, and a cancel.

client.py PORT COUNT: each of them COUNT times (the cancel a fifth of that), one after the other. Prints a line of
JSON: the times of each, in seconds.
"""

import json
import sys
import threading
import time

import roslibpy

PORT, COUNT = int(sys.argv[1]), int(sys.argv[2])
clock = time.perf_counter

ros = roslibpy.Ros(host="127.0.0.1", port=PORT)
ros.run()
took = {"message": [], "goal": [], "cancel": []}

heard = threading.Event()
listening = roslibpy.Topic(ros, "/heard", "std_msgs/msg/Int32")
listening.subscribe(lambda message: heard.set())
saying = roslibpy.Topic(ros, "/said", "std_msgs/msg/Int32")
saying.advertise()
for n in range(COUNT):
    begun = clock()
    saying.publish(roslibpy.Message({"data": n}))
    heard.wait()
    took["message"].append(clock() - begun)
    heard.clear()

action = roslibpy.ActionClient(ros, "/any", "test_msgs/action/Fibonacci")


def send(order):
    return action.send_goal(roslibpy.Goal({"order": order}), *[lambda _: None] * 3)


for _ in range(COUNT):
    begun = clock()
    action.wait_goal(send(0))
    took["goal"].append(clock() - begun)
for _ in range(COUNT // 5):
    name = send(1)
    time.sleep(0.001)
    begun = clock()
    action.cancel_goal(name)
    action.wait_goal(name)
    took["cancel"].append(clock() - begun)
print(json.dumps(took))
ros.close()
