"""What the hand reports: irregular samples, counts, raw current, commands."""

import numpy as np

from .motions import Programme
from .plan import LogTable, Plan
from .stepper import STEP_S, Run

INTERVAL_S, JITTER, LOST = 0.018, 0.35, 0.002
HEADER = "time,position,current,setpoint,speed,current_limit\n"


def sample_times(duration: float, rng: np.random.Generator) -> np.ndarray:
    """Sampling instants on the true clock, 0.2 % of the rows lost."""
    count = int(duration / (INTERVAL_S * (1 - JITTER))) + 2
    times = np.cumsum(INTERVAL_S * rng.uniform(1 - JITTER, 1 + JITTER, count))
    times = times[times < duration - 0.01]
    return times[rng.random(len(times)) > LOST]


def clean_log(plan: Plan, run: Run, moves: Programme, times: np.ndarray, rng: np.random.Generator) -> LogTable:
    """The log at these instants before noise and rounding."""
    low, high = plan.finger.counts
    scale = (high - low) / 100
    position = np.interp(times - plan.position_delay, run.time, run.position)
    current = np.interp(times - plan.current_delay, run.time, run.current)
    reference = np.interp(times, np.arange(len(moves.position)) * STEP_S, moves.position)
    table = LogTable(times.copy(), low + scale * position, current, run, low + scale * reference)
    for change in plan.log_steps:
        change(table, rng)
    return table


def write_log(plan: Plan, run: Run, moves: Programme, base: float, rng: np.random.Generator) -> str:
    """The CSV text of one trial's log."""
    times = sample_times(moves.duration, rng)
    table = clean_log(plan, run, moves, times, rng)
    table.counts = np.round(table.counts + rng.normal(0, plan.noise["counts"], len(times)))
    noisy = table.current + rng.normal(0, plan.noise["current"], len(times))
    table.current = np.clip(noisy, -plan.current_clip, plan.current_clip)
    if plan.replace_log is not None:
        plan.replace_log(table, rng)
    low, high = plan.finger.counts
    which = np.searchsorted([c[0] for c in moves.commands], times, side="right") - 1
    stamps = base + plan.clock(table.time)
    rows = []
    for t, counts, raw, k in zip(stamps, table.counts, table.current, which, strict=True):
        _, target, fraction = moves.commands[k]
        setpoint = low + (high - low) * target / 100
        rows.append(f"{t:.5f},{counts:.0f},{raw:.0f},{setpoint:.0f},{round(255 * fraction)},255")
    return HEADER + "\n".join(rows) + "\n"
