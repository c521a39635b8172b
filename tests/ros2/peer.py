"""Another node, in a process of its own, that shares no code with the package.

It is made of the types and the encoder of cyclonedds, written by hand, and of rosbags. It echoes
each Twist on /cmd_vel as an Odometry on /odom, and prints what it sees of the others as JSON when a
line arrives; after the line "room" it publishes a map, a transform and a scan in a square room.
Arguments: domain, humble or jazzy.
"""

import json
import math
import sys
import threading
import time
from dataclasses import dataclass
from types import new_class

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
)
from cyclonedds.core import Policy, Qos, ReadCondition, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import (
    array,
    bounded_str,
    float32,
    float64,
    int8,
    int32,
    sequence,
    uint8,
    uint32,
)
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

DOMAIN, DISTRIBUTION = int(sys.argv[1]), sys.argv[2]
GID = 24 if DISTRIBUTION == "humble" else 16
CONFIGURATION = """<CycloneDDS><Domain><General>
<Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<Peers><Peer Address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""
FOREVER = 2**63 - 1


def struct(package, name, **fields):
    """A message type of ROS 2 as cyclonedds has it."""
    typename = f"{package}.msg.dds_.{name}_"
    fill = {"__annotations__": fields, "__module__": __name__}
    made = new_class(name, (IdlStruct,), {"typename": typename}, lambda body: body.update(fill))
    return dataclass(made)


XYZ = dict.fromkeys("xyz", float64)
Vector3 = struct("geometry_msgs", "Vector3", **XYZ)
Point = struct("geometry_msgs", "Point", **XYZ)
Quaternion = struct("geometry_msgs", "Quaternion", **XYZ, w=float64)
Pose = struct("geometry_msgs", "Pose", position=Point, orientation=Quaternion)
Twist = struct("geometry_msgs", "Twist", linear=Vector3, angular=Vector3)
COVARIANCE = array[float64, 36]
PoseWithCovariance = struct("geometry_msgs", "PoseWithCovariance", pose=Pose, covariance=COVARIANCE)
TwistWithCovariance = struct(
    "geometry_msgs", "TwistWithCovariance", twist=Twist, covariance=COVARIANCE
)
Time = struct("builtin_interfaces", "Time", sec=int32, nanosec=uint32)
Header = struct("std_msgs", "Header", stamp=Time, frame_id=str)
Odometry = struct(
    "nav_msgs",
    "Odometry",
    header=Header,
    child_frame_id=str,
    pose=PoseWithCovariance,
    twist=TwistWithCovariance,
)
Transform = struct("geometry_msgs", "Transform", translation=Vector3, rotation=Quaternion)
TransformStamped = struct(
    "geometry_msgs",
    "TransformStamped",
    header=Header,
    child_frame_id=str,
    transform=Transform,
)
TFMessage = struct("tf2_msgs", "TFMessage", transforms=sequence[TransformStamped])
MapMetaData = struct(
    "nav_msgs",
    "MapMetaData",
    map_load_time=Time,
    resolution=float32,
    width=uint32,
    height=uint32,
    origin=Pose,
)
OccupancyGrid = struct(
    "nav_msgs", "OccupancyGrid", header=Header, info=MapMetaData, data=sequence[int8]
)
LaserScan = struct(
    "sensor_msgs",
    "LaserScan",
    header=Header,
    **dict.fromkeys(
        ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time"), float32
    ),
    range_min=float32,
    range_max=float32,
    ranges=sequence[float32],
    intensities=sequence[float32],
)
Gid = struct("rmw_dds_common", "Gid", data=array[uint8, GID])
NodeEntitiesInfo = struct(
    "rmw_dds_common",
    "NodeEntitiesInfo",
    node_namespace=bounded_str[256],
    node_name=bounded_str[256],
    reader_gid_seq=sequence[Gid],
    writer_gid_seq=sequence[Gid],
)
ParticipantEntitiesInfo = struct(
    "rmw_dds_common",
    "ParticipantEntitiesInfo",
    gid=Gid,
    node_entities_info_seq=sequence[NodeEntitiesInfo],
)


def qos(history, durability=Policy.Durability.Volatile, type_name=""):
    """QoS of an endpoint; from Iron on with the hash of its type."""
    mark = b""
    if type_name and DISTRIBUTION != "humble":
        from rosbags.typesys import Stores, get_typestore

        mark = f"typehash={get_typestore(Stores.ROS2_JAZZY).hash_rihs01(type_name)};".encode()
    return Qos(
        Policy.Reliability.Reliable(FOREVER),
        durability,
        history,
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(mark),
    )


def gid_of(entity):
    return Gid(list(entity.get_guid().bytes.ljust(GID, b"\0")))


class Peer:
    def __init__(self):
        self.domain = Domain(DOMAIN, CONFIGURATION)
        self.participant = DomainParticipant(DOMAIN, Qos(Policy.Userdata(b"enclave=/;")))
        last, latched = Policy.History.KeepLast(10), Policy.Durability.TransientLocal
        info = Topic(self.participant, "ros_discovery_info", ParticipantEntitiesInfo)
        commands = Topic(self.participant, "rt/cmd_vel", Twist)
        odometry = Topic(self.participant, "rt/odom", Odometry)
        self.info = DataWriter(self.participant, info, qos(Policy.History.KeepLast(1), latched))
        self.infos = DataReader(self.participant, info, qos(Policy.History.KeepAll, latched))
        self.commands = DataReader(
            self.participant, commands, qos(last, type_name="geometry_msgs/msg/Twist")
        )
        self.odometry = DataWriter(
            self.participant, odometry, qos(last, type_name="nav_msgs/msg/Odometry")
        )
        node = NodeEntitiesInfo("/", "peer", [gid_of(self.commands)], [gid_of(self.odometry)])
        self.info.write(ParticipantEntitiesInfo(gid_of(self.participant), [node]))
        self.views = {
            "participants": BuiltinDataReader(self.participant, BuiltinTopicDcpsParticipant),
            "publications": BuiltinDataReader(self.participant, BuiltinTopicDcpsPublication),
        }
        self.seen, self.count = {}, 0

    def echo(self):
        """Answer each command at once, for ever."""
        waitset = WaitSet(self.participant)
        waitset.attach(ReadCondition(self.commands, 0x1 | 0x2 | 0x1C | 0x60))
        while True:
            waitset.wait(10**9)
            for twist in self.commands.take(1000):
                self.count += 1
                orientation = Quaternion(0.0, 0.0, 0.0, 1.0)
                pose = Pose(Point(float(self.count), 0.0, 0.0), orientation)
                self.odometry.write(
                    Odometry(
                        Header(Time(1, 2), "odom"),
                        "base_link",
                        PoseWithCovariance(pose, [0.0] * 36),
                        TwistWithCovariance(twist, [0.5] * 36),
                    )
                )

    def room(self):
        """Publish a map, the mounting of a scanner, odometry and a scan.

        The room has 4 m by 6 m and its lower left corner at the origin of the map; the robot is at
        (1.5, 2.0) with the heading 0.3, its scanner 0.2 m ahead and turned by pi.
        """
        last, latched = Policy.History.KeepLast(1), Policy.Durability.TransientLocal
        writers = []
        for name, kind, type_name, durability in (
            ("map", OccupancyGrid, "nav_msgs/msg/OccupancyGrid", latched),
            ("tf_static", TFMessage, "tf2_msgs/msg/TFMessage", latched),
            ("scan", LaserScan, "sensor_msgs/msg/LaserScan", Policy.Durability.Volatile),
        ):
            topic = Topic(self.participant, f"rt/{name}", kind)
            writers.append(DataWriter(self.participant, topic, qos(last, durability, type_name)))
        cells = [100 if i in {0, 121} or k in {0, 81} else 0 for i in range(122) for k in range(82)]
        level, zero = Quaternion(0.0, 0.0, 0.0, 1.0), [0.0] * 36
        info = MapMetaData(Time(0, 0), 0.05, 82, 122, Pose(Point(-0.05, -0.05, 0.0), level))
        writers[0].write(OccupancyGrid(Header(Time(0, 0), "map"), info, cells))
        behind = Transform(Vector3(0.2, 0.0, 0.2), Quaternion(0.0, 0.0, 1.0, 0.0))
        mounting = TransformStamped(Header(Time(0, 0), "base_link"), "laser", behind)
        writers[1].write(TFMessage([mounting]))
        x, y = 1.5 + 0.2 * math.cos(0.3), 2.0 + 0.2 * math.sin(0.3)
        ranges = []
        for k in range(360):
            angle = 0.3 + k * math.pi / 180.0
            c, s = math.cos(angle), math.sin(angle)
            to_side, to_end = (4.0 if c > 0.0 else 0.0) - x, (6.0 if s > 0.0 else 0.0) - y
            ranges.append(min(to_side / c, to_end / s))
        for _ in range(20):
            now = time.time_ns()
            stamp = Time(now // 10**9, now % 10**9)
            twist = TwistWithCovariance(Twist(Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)), zero)
            pose = PoseWithCovariance(Pose(Point(7.0, 8.0, 0.0), level), zero)
            self.odometry.write(Odometry(Header(stamp, "odom"), "base_link", pose, twist))
            head = Header(stamp, "laser")
            step = math.pi / 180.0
            first = -math.pi
            writers[2].write(
                LaserScan(head, first, first + 359.0 * step, step, 0.0, 0.1, 0.05, 20.0, ranges, [])
            )
            time.sleep(0.1)

    def report(self):
        """Nodes by participant, and USER_DATA of participants and publications."""
        for info in self.infos.take(1000):
            self.seen[bytes(info.gid.data).hex()] = [
                [n.node_namespace, n.node_name, len(n.reader_gid_seq), len(n.writer_gid_seq)]
                for n in info.node_entities_info_seq
            ]
        found = {"nodes": self.seen, "count": self.count}
        for name, view in self.views.items():
            found[name] = {
                each.key.bytes.hex(): [
                    getattr(each, "topic_name", ""),
                    getattr(each, "type_name", ""),
                    each.qos[Policy.Userdata].data.decode() if Policy.Userdata in each.qos else "",
                ]
                for each in view.read(1000)
                if each.sample_info.valid_data
            }
        return found


if __name__ == "__main__":
    peer = Peer()
    print("ready", flush=True)
    threading.Thread(target=peer.echo, daemon=True).start()
    for line in sys.stdin:
        if line == "room\n":
            peer.room()
            continue
        print(json.dumps(peer.report()), flush=True)
