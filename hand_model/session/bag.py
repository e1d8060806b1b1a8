"""Logs in ROS 2 bags: rosbag2 folders (sqlite3 or MCAP storage) and single MCAP files, read through `rosbags`.

The session format names the columns; this module says which messages carry them:

- a message with one number in a field `data` (std_msgs/Float64, Float32, Int32, ...): the column is the last component
of
  the topic, `/hand/index/position` -> `position`, less the actuator's name, `/index_position` -> `position`;
- sensor_msgs/JointState: `position`, `velocity`, `effort` of a joint, `effort` also as `current`; with several joints
in
  the message the columns are `<joint>_position` and so on, and those of the joint named like the actuator also go by
  the plain names;
- any other message: each scalar number field at its top level is a column of that name.

Where several topics give the same column, the topic with the actuator's name among its components is meant; the others
are called `<component before the last>_<column>` (for a message of named fields `<last component>_<column>`).

Time is the header's stamp, or the time of reception where there is no header or its stamp is zero. The times of the log
are those of the topic that gives `position` (or of the busiest topic); from every other topic the nearest message is
taken, if it is no further away than half the longer of the two sampling intervals: otherwise the sample is lost (nan).
Commands (`setpoint`, `speed`, `current_limit`) hold until the next message, since a command is often sent only when it
changes.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SessionError
from .log import Log, build_log

Array = NDArray[np.float64]

HELD = ("setpoint", "speed", "current_limit")
NUMBERS = (bool, int, float, np.number)


@dataclass(frozen=True)
class _Channel:
    """One topic: its times (n,) [s] and columns (n,). single: the column is the topic's last component."""

    topic: str
    time_s: Array
    columns: dict[str, Array]
    single: bool


def read_bag(path: Path, actuator: str | None = None) -> Log:
    """Read a rosbag2 folder or a single MCAP file as a log; actuator: whose columns get the plain names.

    Raises SessionError where the bag cannot be read, or holds no message with numbers.
    """
    messages, notes = _messages(path)
    channels = [channel for topic, rows in sorted(messages.items()) if (channel := _channel(topic, rows, actuator))]
    if not channels:
        raise SessionError(f"{path}: the bag holds no message with numbers; position, current, ... are needed")
    named = _named(channels, actuator)
    lead = next((channel for name, channel, _ in named if name == "position"), None)
    lead = lead or max(channels, key=lambda channel: len(channel.time_s))
    columns = {
        name: column if channel is lead else _sampled(lead.time_s, channel.time_s, column, name in HELD)
        for name, channel, column in named
        if len(channel.time_s)
    }
    return build_log(lead.time_s, columns, path, notes)


def _messages(path: Path) -> tuple[dict[str, list[tuple[int, Any]]], list[str]]:
    """Messages by topic, each with its time of reception [ns], and a note on every topic that cannot be decoded."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise SessionError(
            f"{path}: no metadata.yaml in this folder; a rosbag2 folder or a single .mcap file is needed"
        )
    found: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    undecodable: dict[str, str] = {}
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            for connection, received_ns, raw in reader.messages():
                if connection.topic in undecodable:
                    continue
                try:
                    message = reader.deserialize(raw, connection.msgtype)
                except Exception:  # noqa: BLE001 a type of the laboratory's own, stored without its definition
                    undecodable[connection.topic] = connection.msgtype
                    found.pop(connection.topic, None)
                else:
                    found[connection.topic].append((received_ns, message))
    except Exception as error:  # noqa: BLE001 rosbags lets sqlite3, yaml, struct and assertion errors through
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise SessionError(f"{path}: not a readable ROS 2 bag ({reason}); export it anew") from None
    return found, [f"topic {topic} ({kind}) cannot be decoded and was ignored" for topic, kind in undecodable.items()]


def _channel(topic: str, rows: list[tuple[int, Any]], actuator: str | None) -> _Channel | None:
    """The numbers of one topic, or None where it has none."""
    stamps_ns = [_stamp_ns(message) for _, message in rows]
    if not all(stamps_ns):
        stamps_ns = [received for received, _ in rows]
    fields = [_numbers(message, actuator) for _, message in rows]
    names = list(dict.fromkeys(name for field in fields for name in field))
    if not names:
        return None
    order = np.argsort(np.array(stamps_ns), kind="stable")
    columns = {name: np.array([field.get(name, np.nan) for field in fields], float)[order] for name in names}
    single = names == ["data"]
    if single:
        name = topic.rstrip("/").rpartition("/")[2]
        columns = {name.removeprefix(f"{actuator}_"): columns["data"]}
    return _Channel(topic, np.array(stamps_ns, float)[order] * 1e-9, columns, single)


def _stamp_ns(message: Any) -> int:
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return 0 if stamp is None else int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _numbers(message: Any, actuator: str | None) -> dict[str, float]:
    """Scalar numbers of one message by column name."""
    if getattr(message, "__msgtype__", "") == "sensor_msgs/msg/JointState":
        return _joint_state(message, actuator)
    fields = {name: value for name, value in vars(message).items() if not name.startswith("_")}
    return {name: float(value) for name, value in fields.items() if isinstance(value, NUMBERS)}


def _joint_state(message: Any, actuator: str | None) -> dict[str, float]:
    joints = list(message.name) or [""]
    found: dict[str, float] = {}
    for field in ("position", "velocity", "effort"):
        for joint, value in zip(joints, getattr(message, field), strict=False):
            plain = len(joints) == 1 or joint == actuator
            for name in (field, "current") if field == "effort" else (field,):
                if plain:
                    found[name] = float(value)
                if len(joints) > 1:
                    found[f"{joint}_{name}"] = float(value)
    return found


def _named(channels: list[_Channel], actuator: str | None) -> list[tuple[str, _Channel, Array]]:
    """Every column with the name that it has in the log."""
    count = Counter(name for channel in channels for name in channel.columns)
    own = {id(channel) for channel in channels if actuator in channel.topic.split("/")}
    owned = Counter(name for channel in channels if id(channel) in own for name in channel.columns)
    named = []
    for channel in channels:
        parts = [part for part in channel.topic.split("/") if part]
        before = (parts[:-1] if channel.single else parts)[-1:]
        for name, column in channel.columns.items():
            plain = count[name] == 1 or (id(channel) in own and owned[name] == 1)
            named.append((name if plain else "_".join([*before, name]), channel, column))
    return named


def _sampled(time_s: Array, source_s: Array, values: Array, held: bool) -> Array:
    """Values (n,) of another topic at the log's times: the message before (held) or the nearest one in reach."""
    after = np.searchsorted(source_s, time_s, side="right")
    if held:
        return np.where(after > 0, values[np.maximum(after - 1, 0)], np.nan)
    left = np.clip(after - 1, 0, len(source_s) - 1)
    right = np.clip(after, 0, len(source_s) - 1)
    nearest = np.where(np.abs(source_s[left] - time_s) <= np.abs(source_s[right] - time_s), left, right)
    intervals = [float(np.median(np.diff(t))) if len(t) > 1 else 0.0 for t in (time_s, source_s)]
    reach_s = 0.5 * max(intervals) + 1e-9
    return np.where(np.abs(source_s[nearest] - time_s) <= reach_s, values[nearest], np.nan)
