"""Small writers of recordings for the tests: every format that the session reader takes, and one whole session."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

UNIT = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}


def write_c3d(path, labels, position_m, rate_hz=100.0, unit="mm", analog=0, units_key=True):
    """C3D by ezc3d (floats, Intel). position_m: (n, m, 3) [m], nan is written as a gap (residual -1)."""
    import ezc3d

    n = len(position_m)
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"] = [rate_hz]
    point["LABELS"]["value"] = list(labels[:255])
    point["DESCRIPTIONS"]["value"] = [""] * len(labels[:255])
    if len(labels) > 255:
        file.add_parameter("POINT", "LABELS2", list(labels[255:]))
        file.add_parameter("POINT", "DESCRIPTIONS2", [""] * len(labels[255:]))
    point["UNITS"]["value"] = [unit if units_key else ""]
    points = np.ones((4, len(labels), n))
    points[:3] = np.moveaxis(position_m, 2, 0).transpose(0, 2, 1) / UNIT[unit]
    file["data"]["points"] = points
    if analog:
        file["parameters"]["ANALOG"]["RATE"]["value"] = [rate_hz * 2]
        file["parameters"]["ANALOG"]["LABELS"]["value"] = [f"A{i}" for i in range(analog)]
        file["data"]["analogs"] = np.arange(analog * 2 * n, dtype=float).reshape(1, analog, 2 * n)
    path.parent.mkdir(parents=True, exist_ok=True)
    lower = path.with_suffix(".c3d")  # ezc3d insists on this ending
    file.write(str(lower))
    return lower.rename(path)


def write_c3d_bytes(path, labels, stored, seen, scale, processor=84, unit="mm", rate_hz=50.0, frames_stated=None):
    """C3D by hand: stored (n, m, 3) in the file's numbers, seen (n, m); scale < 0 floats, else 16-bit integers."""
    order = ">" if processor == 86 else "<"

    def floats(values):
        if processor != 85:
            return np.asarray(values, order + "f4").tobytes()
        halves = (np.asarray(values, "<f4") * np.float32(4)).view("<u2").reshape(-1, 2)[:, ::-1]
        return np.ascontiguousarray(halves).tobytes()

    def parameter(name, kind, shape, raw):
        body = struct.pack("<bB", kind, len(shape)) + bytes(shape) + raw + b"\0"
        return struct.pack("<bb", len(name), 1) + name.encode() + struct.pack(order + "H", len(body) + 2) + body

    n, m = seen.shape
    width = max(len(label) for label in labels)
    blob = bytes([1, 0x50, 3, processor])
    blob += struct.pack("<bb", 5, -1) + b"POINT" + struct.pack(order + "H", 3) + b"\0"
    blob += parameter("USED", 2, [], struct.pack(order + "H", m))
    blob += parameter("SCALE", 4, [], floats([scale]))
    blob += parameter("RATE", 4, [], floats([rate_hz]))
    blob += parameter("UNITS", -1, [2], unit.ljust(2).encode())
    blob += parameter("LABELS", -1, [width, m], "".join(label.ljust(width) for label in labels).encode())
    blob = (blob + b"\0\0").ljust(3 * 512, b"\0")
    header = bytes([2, 0x50]) + struct.pack(order + "HHHHH", m, 0, 1, (frames_stated or n) & 0xFFFF, 10)
    header += floats([scale]) + struct.pack(order + "HH", 5, 0) + floats([rate_hz])
    quads = np.concatenate([stored, np.where(seen, 0, -1)[..., None]], axis=2)
    body = floats(quads.ravel()) if scale < 0 else quads.astype(order + "i2").tobytes()
    path.write_bytes(header.ljust(512, b"\0") + blob + body)
    return path


def write_tsv(path, labels, position_m, rate_hz=100.0, frame_time=True, column_header=True, gap="", frames=None):
    """QTM TSV in millimetres."""
    n = len(position_m)
    lines = [f"NO_OF_FRAMES\t{frames or n}", "NO_OF_CAMERAS\t7", f"NO_OF_MARKERS\t{len(labels)}"]
    lines += [f"FREQUENCY\t{rate_hz:g}", "NO_OF_ANALOG\t0", "DATA_INCLUDED\t3D", "\t".join(["MARKER_NAMES", *labels])]
    lead = ["Frame", "Time"] if frame_time else []
    if column_header:
        lines.append("\t".join([*lead, *(f"{label} {axis}" for label in labels for axis in "XYZ")]))
    for i, frame in enumerate(position_m):
        cells = [str(i + 1), f"{i / rate_hz:.5f}"] if frame_time else []
        cells += [gap if np.isnan(x) else f"{x * 1000:.4f}" for x in frame.ravel()]
        lines.append("\t".join(cells))
    path.write_text("\r\n".join(lines) + "\r\n")
    return path


def write_trc(path, labels, position_m, rate_hz=100.0, unit="mm", gap="", frames=None, blank=True):
    """OpenSim TRC."""
    n = len(position_m)
    lines = [f"PathFileType\t4\t(X/Y/Z)\t{path.name}"]
    lines.append("DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames")
    lines.append(f"{rate_hz:g}\t{rate_hz:g}\t{frames or n}\t{len(labels)}\t{unit}\t{rate_hz:g}\t1\t{n}")
    lines.append("Frame#\tTime\t" + "\t\t\t".join(labels) + "\t\t")
    lines.append("\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(len(labels)) for axis in "XYZ"))
    lines += [""] * blank
    for i, frame in enumerate(position_m):
        cells = [str(i + 1), f"{i / rate_hz:.6f}"]
        cells += [gap if np.isnan(x) else f"{x / UNIT[unit]:.7f}" for x in frame.ravel()]
        lines.append("\t".join(cells))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_motive(path, labels, position_m, rate_hz=100.0, unit="Meters", version="1.23", rigid_body=True, frames=None):
    """Motive CSV: a rigid body (rotation, position, error), its fitted markers, then the measured markers."""
    scale = {"Meters": 1.0, "Centimeters": 1e-2, "Millimeters": 1e-3, "": 1e-3}[unit]
    n = len(position_m)
    top = ["Format Version", version, "Take Name", "take", "Capture Frame Rate", f"{rate_hz:.6f}"]
    top += [
        "Export Frame Rate",
        f"{rate_hz:.6f}",
        "Total Exported Frames",
        str(frames or n),
        "Rotation Type",
        "Quaternion",
    ]
    top += (["Length Units", unit] if unit else []) + ["Coordinate Space", "Global"]
    columns = []
    if rigid_body:
        columns += [("Rigid Body", "RB", "1", "Rotation", axis) for axis in "XYZW"]
        columns += [("Rigid Body", "RB", "1", "Position", axis) for axis in "XYZ"]
        columns += [("Rigid Body", "RB", "1", "Mean Marker Error", "")]
        columns += [("Rigid Body Marker", "RB:Marker1", "2", "Position", axis) for axis in "XYZ"]
        columns += [("Rigid Body Marker", "RB:Marker1", "2", "Marker Quality", "")]
    own = len(columns)
    columns += [("Marker", label, str(9 + i), "Position", axis) for i, label in enumerate(labels) for axis in "XYZ"]
    lines = [",".join(top), ""]
    for row, key in enumerate(["Type", "Name", "ID", ""]):
        lines.append(",".join(["", key, *(column[row] for column in columns)]))
    lines.append(",".join(["Frame", "Time (Seconds)", *(column[4] for column in columns)]))
    for i, frame in enumerate(position_m):
        cells = [str(i), f"{i / rate_hz:.6f}", *["7.5"] * own]
        cells += ["" if np.isnan(x) else f"{x / scale:.9f}" for x in frame.ravel()]
        lines.append(",".join(cells))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_bag(path, topics, storage="sqlite3", version=9):
    """rosbag2 folder. topics: name -> (message type, [(received_s, fields)]); a `header` of seconds becomes a stamp."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64 position\nfloat64 current\nstring note\n", "lab_msgs/msg/Finger"))
    kinds = store.types
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    with Writer(path, version=version, storage_plugin=plugin) as writer:
        for topic, (kind, rows) in topics.items():
            connection = writer.add_connection(topic, kind, typestore=store)
            for received_s, fields in rows:
                fields = dict(fields)
                if "header" in fields:
                    ns = round(fields["header"] * 1e9)
                    stamp = kinds["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
                    fields["header"] = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="")
                writer.write(connection, round(received_s * 1e9), store.serialize_cdr(kinds[kind](**fields), kind))
    return path


PALM = ("PO", "PM", "PL")
PROBE = {"T1": [0.0, 0.0, 0.085], "T2": [0.0, 0.0, 0.125], "T3": [0.034, 0.0, 0.11]}
FINGERS = {"index": (("IP1", "IP2", "IP3"), ("ID1", "ID2", "ID3")), "ring": (("RP1", "RP2", "RP3"),)}

MANIFEST = """format = "hand-session/1"

[hand]
name = "test hand"
side = "left"

[world]
gravity = [0.0, 0.0, -9.81]

[palm]
markers = { origin = "PO", medial = "PM", lateral = "PL" }

[probe]
markers = { T1 = [0.0, 0.0, 0.085], T2 = [0.0, 0.0, 0.125], T3 = [0.034, 0.0, 0.11] }

[[actuator]]
name = "index"
speed_full = 255
current_full = 255

[[finger]]
name = "index"
actuator = "index"
segments = [
  { name = "proximal", markers = ["IP1", "IP2", "IP3"] },
  { name = "distal", markers = ["ID1", "ID2", "ID3"] },
]

[[finger]]
name = "ring"
segments = [{ name = "proximal", markers = ["RP1", "RP2", "RP3"] }]

[[trial]]
kind = "flexion"
finger = "index"
mocap = "mocap/index.c3d"
log = "log/index.csv"

[[trial]]
kind = "flexion"
finger = "ring"
mocap = "mocap/ring.tsv"

[[trial]]
kind = "excitation"
finger = "index"
log = "log/excitation.csv"
purpose = "validate"

[[trial]]
kind = "grasp"
finger = "index"
log = "log/grasp.csv"
object = "cylinder"
stiffness = "stiff"

[[trial]]
kind = "landmark"
name = "origin"
mocap = "mocap/origin.c3d"

[[trial]]
kind = "landmark"
name = "medial"
mocap = "mocap/medial.c3d"

[[trial]]
kind = "landmark"
name = "lateral"
mocap = "mocap/lateral.c3d"

[[trial]]
kind = "joint_probe"
finger = "index"
joint = "proximal"
side = "medial"
mocap = "mocap/joint.c3d"

[[trial]]
kind = "surface"
segment = "index/proximal"
mocap = "mocap/surface.c3d"
"""


def rigid_markers(labels, frames, seed=0, noise_m=1e-4):
    """A tumbling cloud of markers (n, m, 3) [m] with triangles 30 mm wide at different places."""
    rng = np.random.default_rng(seed)
    base = rng.uniform(-0.04, 0.04, (len(labels), 3))
    for i in range(0, len(labels) - 2, 3):  # each three: a proper triangle
        base[i : i + 3] = base[i] + [[0, 0, 0], [0.03, 0, 0.002], [0.01, 0.025, 0]]
    for i, label in enumerate(labels):
        if label in PROBE:
            base[i] = PROBE[label]
    angle = np.linspace(0, 1.2, frames)
    turn = np.zeros((frames, 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0], turn[:, 0, 1], turn[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
    return base @ turn.transpose(0, 2, 1) + [0.4, -0.2, 1.1] + rng.normal(0, noise_m, (frames, len(labels), 3))


def write_log(path, seed=0, n=300, moving=True):
    """CSV log with irregular sampling, one lost sample and one column nobody knows."""
    rng = np.random.default_rng(seed)
    time_s = 1000.0 + np.cumsum(rng.uniform(0.012, 0.024, n))
    position = 12000 + (800 * np.sin((time_s - 1000.0) / 0.72) if moving else 0) + rng.normal(0, 3, n)
    current = rng.normal(0, 20, n)
    rows = [f"{t:.5f},{p:.0f},{c:.0f},12000,1" for t, p, c in zip(time_s, position, current, strict=True)]
    cells = rows[5].split(",")
    rows[5] = ",".join([cells[0], "", *cells[2:]])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("time,position,current,setpoint,mood\n" + "\n".join(rows) + "\n")
    return path


def write_session(root: Path) -> Path:
    """A complete small session: two fingers, one without a motor, all kinds of trials."""
    (root / "mocap").mkdir(parents=True)
    (root / "session.toml").write_text(MANIFEST)
    index = [*PALM, *FINGERS["index"][0], *FINGERS["index"][1]]
    write_c3d(root / "mocap/index.c3d", index, rigid_markers(index, 500))
    ring = [*PALM, *FINGERS["ring"][0]]
    write_tsv(root / "mocap/ring.tsv", ring, rigid_markers(ring, 60))
    probed = [*PALM, *PROBE]
    for i, name in enumerate(("origin", "medial", "lateral", "joint", "surface")):
        write_c3d(root / f"mocap/{name}.c3d", probed, rigid_markers(probed, 30, seed=i))
    for i, name in enumerate(("index", "excitation", "grasp")):
        write_log(root / f"log/{name}.csv", seed=i)
    return root
