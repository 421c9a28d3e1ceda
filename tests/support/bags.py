"""Bags of the small simulated recording: ROS 1, ROS 2 and MCAP, as a robot writes them."""

import io
from pathlib import Path

import numpy as np
from PIL import Image

from vgps.readers.recording import open_recording

CORRELATIONS = np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.25], [0.0, 0.25, 1.0]])
UNIX_S = 1_748_779_200  # 2025-06-01 12:00:00 UTC


def messages(recording: Path, store, every=1, raw=False, ros1=False):
    """Yield topic, type, time [ns] and message of images, fixes, rates and calibration, by time."""
    opened = open_recording(recording)
    found = [
        *images(opened, store, every, raw, ros1),
        *fixes(recording, store, ros1),
        *rates(opened, store, ros1),
    ]
    return sorted(found, key=lambda one: one[2])


def header(store, t_s, ros1):
    nanoseconds = round(t_s * 1e9) + UNIX_S * 10**9
    kind = store.types["builtin_interfaces/msg/Time"]
    stamp = kind(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    extra = {"seq": 0} if ros1 else {}
    return nanoseconds, store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera", **extra)


def images(opened, store, every, raw, ros1):
    camera = opened.camera
    upper = ("D", "K", "R", "P") if ros1 else ("d", "k", "r", "p")
    values = (np.zeros(5), camera.K.ravel(), np.eye(3).ravel(), np.zeros(12))
    for index, picture in opened.video.pictures(range(0, len(opened.video.times_s), every)):
        stamp, head = header(store, opened.video.times_s[index], ros1)
        kind = "sensor_msgs/msg/Image" if raw else "sensor_msgs/msg/CompressedImage"
        if raw:
            height, width = picture.shape[:2]
            body = {"height": height, "width": width, "encoding": "bgr8", "is_bigendian": 0}
            body["step"] = 3 * width
            data = np.ascontiguousarray(picture[..., ::-1]).ravel()
        else:
            stream = io.BytesIO()
            Image.fromarray(picture).save(stream, "JPEG", quality=95)
            body, data = {"format": "jpeg"}, np.frombuffer(stream.getvalue(), np.uint8)
        yield "/camera/image", kind, stamp, store.types[kind](header=head, data=data, **body)
        if index == 0:
            region = store.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
            info = store.types["sensor_msgs/msg/CameraInfo"](
                header=head,
                height=camera.height,
                width=camera.width,
                distortion_model="plumb_bob",
                **dict(zip(upper, values, strict=True)),
                binning_x=0,
                binning_y=0,
                roi=region,
            )
            yield "/camera/info", "sensor_msgs/msg/CameraInfo", stamp, info


def fixes(recording, store, ros1):
    log = open_recording(recording).gps
    for row in range(len(log)):
        stamp, head = header(store, log.t_s[row], ros1)
        message = store.types["sensor_msgs/msg/NavSatFix"](
            header=head,
            status=store.types["sensor_msgs/msg/NavSatStatus"](status=2, service=1),
            latitude=float(log.latitude_deg[row]),
            longitude=float(log.longitude_deg[row]),
            altitude=float(log.height_m[row]),
            position_covariance=(log.sigma_m[row][:, None] * CORRELATIONS * log.sigma_m[row]).ravel(),
            position_covariance_type=2,
        )
        yield "/fix", "sensor_msgs/msg/NavSatFix", stamp, message


def rates(opened, store, ros1):
    vector, turn = store.types["geometry_msgs/msg/Vector3"], store.types["geometry_msgs/msg/Quaternion"]
    for t_s, rate in zip(opened.gyro.t_s[::10], opened.gyro.rate_rad_s[::10], strict=True):
        stamp, head = header(store, t_s, ros1)
        message = store.types["sensor_msgs/msg/Imu"](
            header=head,
            orientation=turn(0.0, 0.0, 0.0, 1.0),
            orientation_covariance=np.zeros(9),
            angular_velocity=vector(*map(float, rate)),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=vector(0.0, 0.0, 9.8),
            linear_acceleration_covariance=np.zeros(9),
        )
        yield "/imu", "sensor_msgs/msg/Imu", stamp, message


def write_ros1(recording, out, **how):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store, connections = get_typestore(Stores.ROS1_NOETIC), {}
    with Writer(out) as writer:
        for topic, kind, stamp, message in messages(recording, store, ros1=True, **how):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], stamp, store.serialize_ros1(message, kind))


def write_ros2(recording, out, **how):
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store, connections = get_typestore(Stores.ROS2_HUMBLE), {}
    with Writer(out, version=9) as writer:
        for topic, kind, stamp, message in messages(recording, store, **how):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], stamp, store.serialize_cdr(message, kind))


def write_mcap(recording, out, **how):
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    store, channels = get_typestore(Stores.ROS2_HUMBLE), {}
    with out.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        for topic, kind, stamp, message in messages(recording, store, **how):
            if topic not in channels:
                text = store.generate_msgdef(kind, ros_version=2)[0].encode()
                schema = writer.register_schema(name=kind, encoding="ros2msg", data=text)
                channels[topic] = writer.register_channel(topic, message_encoding="cdr", schema_id=schema)
            data = bytes(store.serialize_cdr(message, kind))
            writer.add_message(channels[topic], log_time=stamp, publish_time=stamp, data=data)
        writer.finish()
