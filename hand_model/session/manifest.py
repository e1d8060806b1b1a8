"""The manifest `session.toml`: read, checked against `hand-session/1`, and turned into a Session.

Where the format is silent:

- A probe whose tip is not known is declared by its labels alone, `[probe] markers = ["T1", "T2", "T3"]`, together with
one
  or more trials `kind = "pivot"` (mocap: the tip stays in a fixed hole while the tool swings); Probe.position_probe is
  None.
- A session of kinematics only has fingers without actuator and `flexion` trials without log. Probe and landmark trials
  are optional; where there are landmark trials, all three landmarks are needed.
- `thumb_0` and `thumb_1` are one thumb in two positions and may carry the same markers; other fingers may not.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import SessionError, did_you_mean
from .node import Node
from .rig import read_rig
from .session import Actuator, Finger, PalmMarkers, Probe, Rig, Segment, Session, Trial
from .trials import TRIAL_KINDS, read_trial

__all__ = [
    "FORMAT",
    "TRIAL_KINDS",
    "Actuator",
    "Finger",
    "PalmMarkers",
    "Probe",
    "Rig",
    "Segment",
    "Session",
    "Trial",
    "read_session",
]

FORMAT = "hand-session/1"
SIDES = ("left", "right")
LANDMARKS = ("origin", "medial", "lateral")
THUMBS = {"thumb_0", "thumb_1"}
PROBED = ("landmark", "joint_probe", "surface", "pivot")


def read_session(path: str | Path) -> Session:
    """Read and check `session.toml` in a folder (or the file itself); marker and log files are read later, by trial.

    What the manifest says is checked completely, and that its files are there; check.check_session reads them.
    Raises SessionError for anything that breaks `hand-session/1`.
    """
    root = Path(path)
    root = root.parent if root.name == "session.toml" else root
    top = _read_toml(root / "session.toml")
    if top.has("rig") and (top.has("palm") or top.has("finger")):
        top.refuse("[rig] stands instead of [palm] and [[finger]]; one of the two is needed")
    nodes = [top]

    def child(key: str) -> Node | None:  # noted, so that its unknown keys are said
        if not top.has(key):
            return None
        nodes.append(top.child(key))
        return nodes[-1]

    is_rig = top.has("rig")
    hand = child("hand") or top.child("hand")
    name, side = hand.text("name"), hand.choice("side", SIDES, *(("right",) if is_rig else ()))
    actuators = _actuators(top.children("actuator", "[[actuator]]"), nodes)
    palm, probe = _palm(child("palm"), top, is_rig), _probe(child("probe"))
    fingers = _fingers(top.children("finger", "[[finger]]"), actuators, nodes)
    rig = read_rig(child("rig"), child("signals"), root) if is_rig else None
    entries = top.children("trial", "[[trial]]")
    nodes += entries
    trials = tuple(read_trial(entry, root, fingers, is_rig) for entry in entries)
    gravity = _gravity(child("world"))
    _check_markers(top, palm, probe, fingers)
    _check_trials(top, palm, probe, fingers, trials, is_rig)
    notes = [note for node in nodes for note in node.unknown()]
    driven = {finger.actuator for finger in fingers}
    notes += [f'actuator "{a.name}" drives no finger' for a in actuators if a.name not in driven and not is_rig]
    return Session(root, name, side, gravity, palm, probe, actuators, fingers, trials, rig, tuple(notes))


def _read_toml(file: Path) -> Node:
    import tomllib

    if not file.is_file():
        raise SessionError(f"{file}: no such file; a session is a folder with a session.toml")
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError, OSError) as error:
        raise SessionError(f"{file}: not readable as TOML ({error}); valid TOML in UTF-8 is needed") from None
    top = Node(file, "", table)
    if not top.has("format") or table["format"] != FORMAT:
        top.refuse(f'format is {table.get("format")!r}; this version reads "{FORMAT}"')
    top.text("format")
    return top


def _gravity(node: Node | None) -> Any:
    gravity = node.numbers("gravity", 3, None) if node else None
    if gravity is None:
        return None
    if np.linalg.norm(gravity) > 100.0:
        node.refuse(f"gravity is {gravity}; metres per second squared are needed, such as [0.0, 0.0, -9.81]")
    return np.array(gravity)


def _palm(node: Node | None, top: Node, is_rig: bool) -> PalmMarkers | None:
    if node is None:
        if not is_rig:
            top.refuse("the table [palm] is missing; it names the palm markers origin, medial and lateral")
        return None
    markers = Node(node.file, "[palm] markers", node.get("markers", dict, "a table of origin, medial, lateral"))
    palm = PalmMarkers(*(markers.text(key) for key in LANDMARKS))
    if extra := sorted(set(markers.table) - set(LANDMARKS)):
        markers.refuse(f'"{extra[0]}" is no palm marker; {did_you_mean(extra[0], LANDMARKS)}')
    return palm


def _probe(node: Node | None) -> Probe | None:
    if node is None:
        return None
    kinds = (dict, list)
    found = node.get("markers", kinds, "a table of positions, or a list of labels where the tip is not known,")
    if isinstance(found, list):
        labels = node.texts("markers")
        if len(labels) < 3:
            node.refuse(
                f"{len(labels)} markers ({', '.join(labels)}); three or more are needed where the tip is not known"
            )
        return Probe(labels, None)
    markers = Node(node.file, "[probe] markers", found)
    position = np.array([markers.numbers(label, 3) for label in found]).reshape(-1, 3)
    reach_m = float(np.linalg.norm(position, axis=1).max(initial=0.0))
    if len(found) and not 0.005 < reach_m < 2.0:
        node.refuse(f"the farthest marker is {reach_m:g} m from the tip; positions in metres are needed")
    if not _determines_tip(position):
        node.refuse(f"{len(found)} markers ({', '.join(found)}); three or more, not on one line, are needed")
    return Probe(tuple(found), position)


def _determines_tip(position: np.ndarray) -> bool:
    """Whether markers (n, 3) [m] fix the tip at the origin: off a line by three percent, or on one that meets the
    tip."""
    if len(position) < 2:
        return False
    middle = position.mean(axis=0)
    _, size, directions = np.linalg.svd(position - middle)
    if size[1] > 0.03 * size[0]:
        return len(position) > 2
    beside_m = float(np.linalg.norm(middle - middle @ directions[0] * directions[0]))
    return size[0] > 0 and beside_m < 1e-3  # a probe that turns unseen about its line moves its tip by no more


def _actuators(entries: list[Node], nodes: list[Node]) -> tuple[Actuator, ...]:
    nodes += entries
    actuators = tuple(Actuator(e.name("name"), e.positive("speed_full"), e.positive("current_full")) for e in entries)
    _once(entries, [actuator.name for actuator in actuators])
    return actuators


def _fingers(entries: list[Node], actuators: tuple[Actuator, ...], nodes: list[Node]) -> tuple[Finger, ...]:
    fingers = []
    for entry in entries:
        name = entry.name("name")
        actuator = entry.choice("actuator", [a.name for a in actuators], None)
        parts = entry.children("segments", f"{entry.where} segment")
        if not parts:
            entry.refuse("the finger has no segment; segments from the palm outwards are needed")
        segments = tuple(Segment(part.name("name"), part.texts("markers")) for part in parts)
        for part, segment in zip(parts, segments, strict=True):
            if len(segment.markers) < 3:
                listed = ", ".join(segment.markers) or "none"
                part.refuse(f"{len(segment.markers)} markers ({listed}); three or more, not on one line, are needed")
        _once(parts, [segment.name for segment in segments])
        nodes += [entry, *parts]
        fingers.append(Finger(name, actuator, segments))
    _once(entries, [finger.name for finger in fingers])
    joints = Counter(f"{finger.name}_{segment.name}" for finger in fingers for segment in finger.segments)
    for joint, count in joints.items():
        if count > 1:
            entries[0].refuse(f'two segments would both be called "{joint}"; rename a finger or a segment')
    return tuple(fingers)


def _once(entries: list[Node], names: list[str]) -> None:
    for i, name in enumerate(names):
        if name in names[:i]:
            entries[i].refuse(f'the name "{name}" is taken twice; each name once is needed')


def _check_markers(top: Node, palm: PalmMarkers | None, probe: Probe | None, fingers: tuple[Finger, ...]) -> None:
    """Refuse a marker that two things carry (the two thumb positions are one thumb)."""
    uses: list[tuple[str, str]] = [(label, "[palm]") for label in palm.labels] if palm else []
    uses += [(label, "[probe]") for label in probe.labels] if probe else []
    uses += [(m, f"{f.name}/{s.name}") for f in fingers for s in f.segments for m in s.markers]
    first: dict[str, str] = {}
    for label, place in uses:
        other = first.setdefault(label, place)
        thumbs = {place.partition("/")[0], other.partition("/")[0]} == THUMBS
        again = other == place and [use for use in uses if use == (label, place)] != [(label, place)]
        if again or (other != place and not thumbs):
            top.refuse(f'the marker "{label}" is used twice, in {other} and {place}; each marker once is needed')


def _check_trials(
    top: Node,
    palm: PalmMarkers | None,
    probe: Probe | None,
    fingers: tuple[Finger, ...],
    trials: tuple[Trial, ...],
    is_rig: bool,
) -> None:
    """What the trials need of the session, and the session of its trials."""
    if not trials:
        top.refuse("there is no [[trial]]; at least one recording is needed")
    if not fingers and not is_rig:
        top.refuse("there is no [[finger]]; at least one, or a [rig], is needed")
    for trial in trials:
        if trial.kind in PROBED and probe is None:
            top.refuse(f'trial "{trial.name}" ({trial.kind}) needs a [probe], and there is none; declare its markers')
    kinds = {trial.kind for trial in trials}
    if probe and probe.position_probe is None and "pivot" not in kinds and kinds & set(PROBED):
        top.refuse('[probe] has no tip; marker positions in metres, or a trial of kind "pivot", are needed')
    probed = {trial.landmark for trial in trials if trial.kind == "landmark"}
    if probed and (missing := [name for name in LANDMARKS if name not in probed]):
        top.refuse(f"no landmark trial for {' and '.join(missing)}; all of {', '.join(LANDMARKS)} are needed, or none")
    for finger in fingers:
        if not any(trial.kind == "flexion" and trial.finger == finger.name for trial in trials):
            top.refuse(f'finger "{finger.name}" has no flexion trial; one is needed to find its axes')
    seen: dict[tuple[Any, ...], Trial] = {}
    for trial in trials:
        key = (trial.kind, trial.finger, trial.landmark, trial.joint, trial.side, trial.segment)
        for file in filter(None, (trial.mocap_path, trial.log_path)):
            other = seen.setdefault((*key, file.resolve()), trial)
            if other is not trial:
                top.refuse(f'trial "{trial.name}" ({trial.kind}) is listed twice; each recording once is needed')
