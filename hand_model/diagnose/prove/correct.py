"""Corrected copies of recordings: what a diagnosis put right, in a session of its own; the original is never
touched."""

from __future__ import annotations

import posixpath
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import HandModelError
from ...output import new_folder, refuse_file
from ...session import Mocap, Session, Trial
from ..findings import FILES, FOLDERS, Finding
from ..locate.angles import FingerAngles, finger_angles
from ..locate.lasting_noise import camera_drift
from ..locate.markers import SLIPS, MarkerNaming, name_markers

Array = NDArray[np.float64]

FOLDER = "corrected"


def refuse_output(output: Path) -> None:
    """Raise HandModelError where `output` is a file, or holds a corrected copy that no diagnosis wrote: recordings are
    never thrown away."""
    refuse_file(output)
    if (output / FOLDER).exists() and not (output / FILES[0]).is_file():
        raise HandModelError(f'{output}: holds "{FOLDER}", which no diagnosis wrote; name another folder')


def write_corrected(
    session: Session,
    findings: Sequence[Finding],
    encoders: Mapping[str, Callable[[Array], Array]],
    output: Path,
    read: Mapping[str, tuple[FingerAngles, MarkerNaming]] | None = None,
) -> Path | None:
    """Write the session with every correction of `findings` applied into `output`/corrected; None where there is none
    to apply.

    encoders: actuator -> correction of its encoder counts. read: finger -> its angles and what its markers tell, where
    that is known already. Marker files become QTM TSV, logs CSV, where they are
    changed; the manifest names them, everything else is copied as it is, but for `output` itself. Replaces an earlier
    copy, whole or not at all.
    """
    markers = {
        finger.name: {f.effect for f in findings if f.effect == "palm_marker_slip" or f.where["finger"] == finger.name}
        & {*SLIPS, "marker_swap"}
        for finger in session.fingers
    }
    drifts = {
        name: f.parameters["rate_minus_one"]["value"]
        for f in findings
        if f.effect == "clock_drift"
        for name in _logs_of(session, f)
    }
    turned = {str(f.where["actuator"]) for f in findings if f.effect == "encoder_periodic_error"} & set(encoders)
    if not any(markers.values()) and not drifts and not turned:
        return None
    target = output / FOLDER
    # `refuse_output` knows that a diagnosis wrote it
    earlier = [entry.name for entry in target.iterdir()] if target.is_dir() else []
    with new_folder(target, earlier) as staging:
        # the output may lie in the session
        ours = {output.resolve(), *(output.resolve() / name for name in (*FILES, *FOLDERS, staging.name))}
        shutil.copytree(
            session.path,
            staging,
            dirs_exist_ok=True,
            ignore=lambda folder, names: [n for n in names if (Path(folder) / n).resolve() in ours],
        )
        renamed: dict[str, str] = {}
        for path, mocap in _corrected_files(session, markers, read or {}).items():
            renamed |= _replace(session, path, staging, ".tsv", lambda file, m=mocap: write_tsv(file, m))
        for trial in session.trials:
            actuator = session.finger(trial.finger).actuator if trial.finger is not None else None
            if trial.log_path is not None and (trial.name in drifts or actuator in turned):
                correct = encoders[actuator] if actuator in turned else None
                renamed |= _write_log(session, trial, drifts.get(trial.name, 0.0), correct, staging)
        _rename(staging / "session.toml", renamed)
    return target


def _logs_of(session: Session, finding: Finding) -> set[str]:
    """Names of the trials whose log a drift concerns: all of its fingers, whose logs ran on one clock."""
    fingers = {t.finger for t in session.trials if t.name in finding.where["trials"]}
    return {t.name for t in session.trials if t.finger in fingers}


def _corrected_files(
    session: Session, markers: Mapping[str, set[str]], read: Mapping[str, tuple[FingerAngles, MarkerNaming]]
) -> dict[Path, Mocap]:
    """Marker file -> what it should have held; one file may hold several fingers. markers: finger -> effects to put
    right."""
    from ...identify.identification import palm_shape

    out: dict[Path, Mocap] = {}
    for finger in (f for f in session.fingers if markers[f.name]):
        if finger.name in read:
            angles, naming = read[finger.name]
        else:
            angles = finger_angles(session, finger, palm_shape(session))
            naming = name_markers(angles, camera_drift(session))
        for index, record in enumerate(angles.records):
            path = Path(str(record.trial.mocap_path))
            out[path] = corrected_markers(angles, naming, index, markers[finger.name], out.get(path, record.mocap))
    return out


def corrected_markers(angles: FingerAngles, naming: MarkerNaming, index: int, applied: set[str], into: Mocap) -> Mocap:
    """One recording with exchanged labels put right and the named slips' displacement taken out. applied: effects that
    were found.
    into: the recording as it is, or as another finger's correction left it."""
    from dataclasses import replace

    record = angles.records[index]
    position = np.array(into.position_world)
    recorded = record.mocap.markers(record.data.labels)
    right = np.array(record.data.position_world if "marker_swap" in applied else recorded)
    blocks = naming.blocks
    mine = np.flatnonzero(blocks.record == index)
    edges = 0.5 * (blocks.time_s[mine][1:] + blocks.time_s[mine][:-1])
    nearest = mine[np.searchsorted(edges, record.mocap.time_s)] if len(mine) else mine
    for found in naming.found if len(mine) else ():
        if found.effect in applied and found.effect in SLIPS:
            shift_palm = (found.columns[nearest] @ found.coefficients).reshape(right.shape)
            right -= np.einsum("nij,nmj->nmi", record.pose.rotation, shift_palm)
    for j, label in enumerate(record.data.labels):
        if not np.array_equal(right[:, j], recorded[:, j], equal_nan=True):
            # the manifest may carry a subject's prefix
            plain = label if label in into.labels else label.rpartition(":")[2]
            position[:, into.labels.index(plain)] = right[:, j]
    return replace(into, position_world=position)


def _write_log(
    session: Session, trial: Trial, drift: float, correct: Callable[[Array], Array] | None, target: Path
) -> dict[str, str]:
    log = trial.log()
    columns = dict(log.columns)
    if correct is not None:
        columns["position"] = correct(columns["position"])
    time_s = log.time_s[0] + (log.time_s - log.time_s[0]) / (1 + drift)
    return _replace(session, trial.log_path, target, ".csv", lambda path: write_csv(path, time_s, columns))


def _replace(
    session: Session, old: Path | None, target: Path, ending: str, write: Callable[[Path], None]
) -> dict[str, str]:
    """Write a file beside the copy of `old`, which is removed; the old path in the manifest and the new one."""
    name = Path(str(old)).relative_to(session.path)
    new = name.with_name(f"{name.stem}_corrected{ending}")
    write(target / new)
    copy = target / name
    shutil.rmtree(copy) if copy.is_dir() else copy.unlink(missing_ok=True)
    return {name.as_posix(): new.as_posix()}


def write_tsv(path: Path, mocap: Mocap) -> None:
    """Marker trajectories as a QTM TSV export in millimetres with frame and time; a gap is an empty cell."""
    names = [f"{label} {axis}" for label in mocap.labels for axis in "XYZ"]
    head = [
        ("NO_OF_FRAMES", len(mocap.time_s)),
        ("NO_OF_MARKERS", len(mocap.labels)),
        ("FREQUENCY", repr(mocap.rate_hz)),
        ("DATA_INCLUDED", "3D"),
        ("MARKER_NAMES", *mocap.labels),
        ("Frame", "Time", *names),
    ]
    rows = ["\t".join(map(str, line)) for line in head]
    flat = 1e3 * mocap.position_world.reshape(len(mocap.time_s), -1)
    for i, (t, row) in enumerate(zip(mocap.time_s.tolist(), flat.tolist(), strict=True), start=1):
        rows.append("\t".join([str(i), repr(t), *("" if np.isnan(x) else f"{x:.6f}" for x in row)]))
    path.write_text("\n".join(rows) + "\n")


def write_csv(path: Path, time_s: Array, columns: Mapping[str, Array]) -> None:
    """A log as CSV with all its digits; an empty cell is a lost sample."""
    rows = [",".join(("time", *columns))]
    for row in np.column_stack([time_s, *columns.values()]).tolist():
        rows.append(",".join("" if np.isnan(x) else repr(x) for x in row))
    path.write_text("\n".join(rows) + "\n")


def _rename(manifest: Path, renamed: Mapping[str, str]) -> None:
    """Put new paths in the place of old ones, in quotes and however they are spelt, and leave the rest of the manifest
    as it is."""

    def new(quoted: re.Match[str]) -> str:
        path = renamed.get(posixpath.normpath(quoted[2]))
        return quoted[0] if path is None else f"{quoted[1]}{path}{quoted[1]}"

    text = manifest.read_text(encoding="utf-8-sig")
    manifest.write_text(re.sub(r"""(["'])((?:(?!\1).)+)\1""", new, text), encoding="utf-8")
