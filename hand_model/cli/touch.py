"""`hand-model touch SESSION`"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable

SUMMARY = "find contacts in grasp trials from the current that free motion does not explain"


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("session", metavar="SESSION", help="folder with a session.toml that has grasp trials")
    parser.add_argument("--actuator", metavar="NAME", help="one actuator (default: every one with a grasp trial)")
    parser.add_argument(
        "--false-alarms", type=float, default=0.1, metavar="N", help="per minute of free motion (default: 0.1)"
    )


def run(options: Namespace, say: Callable[[str], None]) -> int:
    """One line per contact."""
    from ..errors import SessionError, did_you_mean
    from ..report.text import columns
    from ..report.words import number
    from ..session import read_session
    from ..touch import touch_session

    session = read_session(options.session)
    grasped = list(dict.fromkeys(t.actuator for t in session.select("grasp") if t.actuator))
    if not grasped:
        raise SessionError(f'{session.path}: no grasp trial; one of kind "grasp" is needed to look for a touch')
    if options.actuator and options.actuator not in grasped:
        raise SessionError(
            f'{session.path}: actuator "{options.actuator}" has no grasp trial; '
            + did_you_mean(options.actuator, grasped)
        )
    rows = []
    for actuator in [options.actuator] if options.actuator else grasped:
        say(f"{actuator}: learning its free motion")
        for contact in touch_session(session, actuator, options.false_alarms):
            k = contact.stiffness
            stiffness = (
                [number(k.value), f"{number(k.ci95[0])} to {number(k.ci95[1])}" if k.ci95 else "–"] if k else ["–", "–"]
            )
            place = [number(contact.onset_s, 3), number(contact.detected_s, 3), number(contact.position, 1)]
            rows.append([contact.trial, actuator, *place, *stiffness, contact.kind])
    if rows:
        print(
            columns(["trial", "actuator", "onset s", "detected s", "at %", "stiffness raw/%", "95 %", "kind"], rows, 2)
        )
    print(f"\n{len(rows)} contacts at {options.false_alarms:g} false alarms per minute")
    return 0
