"""Session -> Findings: three stations, corrections of the recording before physics, one ranked list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from ..background import Pair, single_threaded
from ..errors import HandModelError, SessionError
from ..hand import Hand
from ..output import replacing
from ..session import Session, read_session
from .assemble import assemble
from .doubtful import refuted, without_refuted
from .findings import FILES, FOLDERS, Findings
from .hearing import Heard
from .locate.drive import drive_trials
from .locate.encoder_error import counts_corrected
from .locate.late_current import timed_drives
from .locate.simulated import delays_apart, simulated_drive
from .name.reread import reread
from .name.station import Station
from .page import write_page
from .prove.correct import refuse_output, write_corrected
from .prove.improve import absent, read_model, refuse_other, write_improved
from .prove.replays import Replay


@single_threaded()
def diagnose(
    session: Session | str | Path,
    model: Any = None,
    output: str | Path | None = None,
    say: Callable[[str], None] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Findings:
    """Say what physics is missing from the declared model of a recorded hand, or of a rig (findings: `RigFindings`).

    session: a session or its folder. model: a Hand, a .hand file or a compiled folder into which the effects are
    written (what is missing is judged by the declared model fitted to the session itself); None identifies the
    session's own, False writes none; a rig brings its own. output: folder that gets `findings.json`, `report.html` and,
    where physics was named, `model_before` and `model`, compiled; where the recording was put right, `corrected`, a
    session. say: called with one line per result as it comes. progress:
    called with the share of the work that is done, 0 to 1.
    Raises SessionError for a session that breaks its format or a rig with a model, HandFileError for a model that is
    none or of another hand, HandModelError for an output that is a file or holds a `corrected` that no diagnosis wrote.
    """
    session = session if isinstance(session, Session) else read_session(session)
    if session.rig is not None:
        return _diagnosed_rig(session, model, output, say)
    hand = read_model(model) if model not in (None, False) else None
    if hand is not None:
        refuse_other(hand, session)
    tell = say or (lambda line: None)
    steps = iter(np.linspace(0, 1, len(session.fingers) + len(drive_trials(session)) + 2).tolist())

    def step() -> None:
        if progress is not None:
            progress(next(steps, 1.0))

    step()
    if output is not None:
        refuse_output(Path(output))
    owned = output is not None and model is None
    heard, told = hear(session, tell, step, (partial(_identified, session),) if owned else ())
    stations = heard.stations
    findings = assemble(stations, heard.found, heard.notes, heard.unexplained)
    listed, written = reread(findings.findings, stations)
    findings = replace(findings, findings=listed)
    if output is not None:
        replays: tuple[Replay, ...] = ()
        with replacing(output, FOLDERS, FILES):
            if model is not False:
                known = told[-1] if owned else hand
                with Pair((findings, session, known, written, heard, Path(output))) as pair:
                    (findings, replays), _ = pair.map(_written, ("model", "corrected"))
            write_page(findings, stations, replays, session.path.name, Path(output))
            findings.save(output)
    if progress is not None:
        progress(1.0)
    return findings


def hear(
    session: Session,
    tell: Callable[[str], None],
    step: Callable[[], None],
    beside: tuple[Callable[[], Any], ...] = (),
) -> tuple[Heard, list[Any]]:
    """What every finger and every drive of a hand session says. tell, step: as of `Heard`. beside: further calls, made where
    a core is free meanwhile; what they return comes second.

    Raises SessionError where a drive's signs contradict each other.
    """
    heard = Heard(session, tell, step)
    read = [a for a in drive_trials(session) if a not in heard.unread]
    told = heard.listen_to_fingers((*(partial(simulated_drive, session, a) for a in read), *beside))
    simulated = delays_apart({d.actuator: d for d in told[: len(read)] if d is not None})
    drives = heard.drives(simulated)
    facts = heard.listen_to_commands(drives, simulated)
    heard.listen_to_drives(*timed_drives(drives, facts, simulated), facts)
    return heard, told[len(read) :]


def _diagnosed_rig(
    session: Session, model: Any, output: str | Path | None, say: Callable[[str], None] | None
) -> Findings:
    """A rig's findings, its report written beside them."""
    from ..report.rig_findings import write_rig_findings
    from ..rig.diagnose import diagnose_rig

    if model not in (None, False):
        raise SessionError(f"{session.path}: a rig session brings its own model; another one is for sessions of a hand")
    findings = diagnose_rig(session, output, say, model is not False)
    if output is not None:
        write_rig_findings(session, findings, output)
    return findings


def _written(results: tuple[Any, ...], what: str) -> Any:
    """What of a diagnosis goes into folders of its own."""
    if what == "model":
        return _modelled(*results)
    findings, session, _, stations, heard, output = results
    read = {name: (heard.fingers[name], markers) for name, markers in heard.markers.items()}
    return write_corrected(session, findings.findings, counts_corrected(session, stations), output, read)


def _identified(session: Session) -> Hand | HandModelError:
    """The session's own hand, or why it has none."""
    from ..identify import identify

    try:
        return identify(session, compared=False)
    except HandModelError as error:
        return error


def _modelled(
    findings: Findings,
    session: Session,
    hand: Hand | HandModelError,
    stations: list[Station],
    heard: Heard,
    output: Path,
) -> tuple[Findings, tuple[Replay, ...]]:
    """The findings with the model that holds them written, and its replays."""
    from .locate.angles import ranges_of_counts

    if not any(f.correction is None for f in findings.findings):
        return findings, ()
    try:
        if isinstance(hand, HandModelError):
            raise hand
        heard.tell(f"writing {output / 'model'}")
        counts, courses = ranges_of_counts(session), heard.courses
        named, replays = write_improved(hand, findings.findings, stations, counts, output, courses)
        if any(refuted(f) for f in named):
            findings = without_refuted(replace(findings, findings=named))
            for folder in FOLDERS[:2]:
                rmtree(output / folder)
            named, replays = write_improved(hand, findings.findings, stations, counts, output, courses)
    except HandModelError as error:
        return replace(findings, notes=(*findings.notes, f"no model was written: {error}")), ()
    known = {f.name for f in hand.fingers}
    lacks = dict.fromkeys(absent(f) for f in named if f.correction is None and f.where["finger"] not in known)
    notes = tuple(f"{what}: what was named there is not in it" for what in lacks)
    return replace(findings, findings=named, notes=(*findings.notes, *notes)), replays
