"""The whole loop on a session that comes with the package: identify, compile, replay, and against the known truth."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import numpy as np

from .errors import HandModelError, did_you_mean
from .hand import Hand

SIDES = ("left", "right")


def embedded_session(side: str) -> Path:
    """Folder of an embedded session, the twin's recording of a "left" (three fingers) or "right" (six fingers)
    BeBionic hand.

    Raises HandModelError for another side.
    """
    if side not in SIDES:
        raise HandModelError(f'no session "{side}" comes with this package; {did_you_mean(side, SIDES)}')
    return Path(str(resources.files("hand_model.assets"))) / "sessions" / side


def demo(side: str = "right", folder: str | Path = "hand_model_demo", say: Callable[[str], None] = print) -> Path:
    """Run the loop, say what happens, write everything into `folder`; returns the path of the report.

    Raises HandModelError for another side, or where the folder holds anything that this did not write.
    """
    from .compile import compile
    from .identify import identify
    from .output import new_file, refuse_foreign
    from .replay import replay
    from .report import write_report
    from .report.text import hand_text, residuals_text

    session, out, name = embedded_session(side), Path(folder), f"bebionic_{side}"
    refuse_foreign(out, [f"bebionic_{s}{ending}" for s in SIDES for ending in ("", ".hand", "_report")])
    start = time.perf_counter()

    def step(text: str) -> None:
        say(f"\n[{time.perf_counter() - start:4.1f} s] {text}")

    step(f"The session: a {side} hand as a laboratory records it, markers and log on two clocks\n  {session}")
    step(
        f"Identify: axes, centres, encoder maps and linkages by maximum likelihood\n  hand-model identify {session} "
        f"--output {out / name}.hand"
    )
    hand = identify(session, lambda line: say(f"  {line}"))
    out.mkdir(parents=True, exist_ok=True)
    with new_file(out / f"{name}.hand") as staging:
        hand.save(staging)
    say("\n" + hand_text(hand))
    step(f"Compile: URDF and MJCF\n  hand-model compile {out / name}.hand --output {out / name}")
    description = compile(hand, out / name)
    for model in description.models:
        say(f"  {model.mjcf}\n  {model.urdf}")
    report = out / f"{name}_report"
    step(
        f"Replay against trials that took no part in the fit\n  hand-model replay {out / name} {session} --output "
        f"{report}"
    )
    residuals = replay(description, session, lambda line: say(f"  {line}"))
    page = write_report(residuals, report)
    say("\n" + residuals_text(residuals))
    step("This recording is the twin's, so the truth is known:")
    say(f"  {truth_words(hand, session.with_name(f'{side}.answer.json'))}")
    step(f"The report: {page.resolve()}")
    return page


def truth_words(hand: Hand, answer: Path) -> str:
    """How far a hand is from the answer of its session: axes [deg] and centres [mm], median and worst."""
    truth = json.loads(answer.read_text())["kinematics"]
    angle, distance = [], []
    for finger in hand.fingers:
        for k, joint in enumerate(finger.joints):
            axis = np.array(truth[finger.name]["axes"][k])
            angle.append(
                np.rad2deg(np.arctan2(np.linalg.norm(np.cross(axis, joint.axis_palm)), axis @ joint.axis_palm))
            )
            distance.append(1e3 * np.linalg.norm(np.array(truth[finger.name]["centres"][k]) - joint.centre_palm))
    return (
        f"axes off by {np.median(angle):.2f} deg (median) and {max(angle):.2f} deg (worst), "
        f"centres by {np.median(distance):.2f} mm and {max(distance):.2f} mm"
    )
