"""How large each effect is: mismatch left by the declared model over the noise, without noise in the way.

cd scripts; python -m seventh_recorder.sizes [draws]
"""

import sys
from dataclasses import replace

import numpy as np

from .catalogue import OUTSIDE, VOCABULARY
from .effect import Effect
from .hand import Finger, draw_hand
from .kinematics import curve, markers_in_palm
from .log_channel import clean_log
from .motions import PACE
from .plan import NOISE, Plan
from .session import drive_trial, finger_trials
from .stepper import Run

CENTRE_STEP, AXIS_STEP = 0.01, 1e-5


def _current_mismatch(plan: Plan, nominal: Plan, rng: np.random.Generator) -> np.ndarray:
    """Residual of the current (raw) over two trials after the declared fit, where the drive moves.

    The base drive's own bristles stand for the sign of the speed, so that nothing hidden leaves almost nothing.
    """
    rows, values = [], []
    for trial in finger_trials("index", False, PACE, np.random.default_rng(0))[1:3]:
        run = drive_trial(plan, trial, rng)
        bristle = drive_trial(nominal, trial, rng).friction
        times = np.arange(0.02, trial.moves.duration - 0.02, 0.018)
        table = clean_log(plan, run, trial.moves, times, rng)
        low, high = plan.finger.counts
        position = (table.counts - low) / (high - low) * 100
        speed = np.interp(times, run.time, run.speed)
        rate = np.interp(times, run.time, np.gradient(run.speed, run.time))
        moving = np.abs(speed) > 3
        columns = [rate, speed, np.interp(times, run.time, bristle), position, np.ones_like(speed)]
        rows.append(np.column_stack(columns)[moving])
        values.append(np.clip(table.current, -plan.current_clip, plan.current_clip)[moving])
    matrix, value = np.concatenate(rows), np.concatenate(values)
    return value - matrix @ np.linalg.lstsq(matrix, value, rcond=None)[0]


def _declared(finger: Finger, position: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Markers of the declared model; change: 4 axis tilts, 4 centre moves, 4 + 5 polynomial terms, 18 marker moves."""
    a, b, c, d = finger.coef
    x = position / 100
    first = finger.angle_full[0] * curve(a, b, x) + np.polyval(change[8:12], x)
    r = first / finger.angle_full[0]
    second = finger.angle_full[1] * curve(c, d, r) + np.polyval(change[12:17], x)
    axes, centres = finger.axes.copy(), finger.centres.copy()
    axes[:, [0, 2]] += change[:4].reshape(2, 2)
    centres[:, [0, 2]] += change[4:8].reshape(2, 2)
    shifted = replace(
        finger,
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        centres=centres,
        markers=finger.markers + change[17:].reshape(2, 3, 3),
    )
    plan = Plan(shifted, NOISE, np.array([0.0, 0.0, 1.0]))
    blank = Run(np.arange(len(position)) * 1e-3, position, position * 0, position * 0, position * 0, position)
    return _posed(plan, blank, first, second)


def _posed(plan: Plan, run: Run, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Markers with both angles given."""
    unit = replace(plan.finger, angle_full=(1.0, 1.0), coef=np.array([1.0, 0.0, 1.0, 0.0]))
    posed = Plan(unit, NOISE, plan.up_palm)
    posed.finger_steps.append(lambda _p, _r: 100 * first)
    posed.distal_steps.append(lambda _a, _r: second)
    return markers_in_palm(posed, run, run.time)


def _marker_mismatch(plan: Plan, nominal: Finger, rng: np.random.Generator) -> np.ndarray:
    """Residual of the markers (mm) given the log's position, the declared model's change projected out."""
    trial = finger_trials("index", False, PACE, np.random.default_rng(0))[1]
    run = drive_trial(plan, trial, rng)
    times = np.arange(0.02, trial.moves.duration - 0.02, 0.06)
    seen = markers_in_palm(plan, run, times)
    table = clean_log(plan, run, trial.moves, times, rng)
    low, high = nominal.counts
    position = np.interp(times, plan.clock(table.time), (table.counts - low) / (high - low) * 100)
    base = _declared(nominal, position, np.zeros(35))
    steps = np.concatenate([np.full(4, AXIS_STEP), np.full(4, CENTRE_STEP), np.full(9, 1e-5), np.full(18, 1e-2)])
    columns = [((_declared(nominal, position, np.eye(35)[k] * h) - base) / h).ravel() for k, h in enumerate(steps)]
    columns.append(np.gradient(base, times, axis=0).ravel())
    matrix, value = np.column_stack(columns), (seen - base).ravel()
    return value - matrix @ np.linalg.lstsq(matrix, value, rcond=1e-9)[0]


def size(effect: Effect | None, law: int, seed: int) -> tuple[float, float]:
    """Mismatch over noise of the current and of the markers for one draw."""
    rng = np.random.default_rng(seed)
    finger = draw_hand(["index"], rng).fingers[0]
    rms = []
    for hidden in (effect, None):
        plan = Plan(finger, NOISE, np.array([0.3, -0.2, 0.93]))
        if hidden is not None:
            hidden.put(plan, 1.0, np.random.default_rng(seed + 1), law)
        current = _current_mismatch(plan, Plan(finger, NOISE, plan.up_palm), np.random.default_rng(seed))
        marker = _marker_mismatch(plan, finger, np.random.default_rng(seed))
        if not (np.isfinite(current).all() and np.isfinite(marker).all()):
            raise FloatingPointError(f"{effect and effect.name}: not finite")
        rms.append([np.mean(current**2), np.mean(marker**2)])
    extra = np.sqrt(np.clip(np.subtract(*rms), 0, None))
    return float(extra[0] / NOISE["current"]), float(extra[1] / NOISE["marker_mm"])


def main() -> None:
    """Print the table of effects and laws: lowest, middle and highest ratio over some draws."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 6
    print(f"{'effect':32s} law  current/noise (low mid high)   markers/noise (low mid high)")
    for effect in VOCABULARY + OUTSIDE:
        for law in range(len(effect.laws)):
            got = np.array([size(effect, law, 100 * law + k) for k in range(draws)])
            low, mid, high = got.min(axis=0), np.median(got, axis=0), got.max(axis=0)
            print(
                f"{effect.name:32s} {law}    {low[0]:6.2f} {mid[0]:6.2f} {high[0]:6.2f}"
                f"          {low[1]:6.2f} {mid[1]:6.2f} {high[1]:6.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
