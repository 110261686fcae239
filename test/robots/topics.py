"""Topics, whose publisher records when it has published which number: as the action servers, with 0 as the order.

/ticks has a message every 0.05 s; /bursts is the same, but silent for 1.5 s after each second; /kept has one message,
which is kept for new subscribers; /nothing has none. /load has as many a second as were last asked for on /rate, for
two seconds.
"""

import sys
import threading
import time

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Int32

record = open(sys.argv[1], "ab", buffering=0)


def publish(publisher, number):
    record.write(f"{time.monotonic():.6f} {publisher.topic_name} 0 {number}\n".encode())
    publisher.publish(Int32(data=number))


def publish_all():
    global number
    number += 1
    publish(ticks, number)
    if number % 50 < 20:
        publish(bursts, number)


def load(message):
    global rate
    # (It is said again and again, for messages may be lost until all know of each other.)
    if message.data != rate:
        rate = message.data
        threading.Thread(target=publish_load, args=(rate,)).start()


def publish_load(rate):
    while loads.get_subscription_count() == 0:
        time.sleep(0.01)
    sent, begun = 0, time.monotonic()
    while sent < 2 * rate:
        while sent < min(2 * rate, (time.monotonic() - begun) * rate):
            sent += 1
            loads.publish(Int32(data=sent))
        time.sleep(0.001)
    record.write(f"{time.monotonic():.6f} /load/{rate} 0 {sent / (time.monotonic() - begun):.0f}\n".encode())


number = rate = 0
rclpy.init()
node = Node("topics")
ticks = node.create_publisher(Int32, "/ticks", 10)
bursts = node.create_publisher(Int32, "/bursts", 10)
nothing = node.create_publisher(Int32, "/nothing", 10)
kept = node.create_publisher(Int32, "/kept", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
publish(kept, 7)
loads = node.create_publisher(Int32, "/load", 1000)
subscription = node.create_subscription(Int32, "/rate", load, 10)
timer = node.create_timer(0.05, publish_all)
record.write(f"{time.monotonic():.6f} topics 0 ready\n".encode())
rclpy.spin(node)
