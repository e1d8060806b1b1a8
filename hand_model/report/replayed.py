"""Sections about a replay: marker error, synchronisation, engines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..published import MARKER_ERROR_M
from ..replay import AGREEMENT_POSES, MODES, PHASES, Residuals, TrialResiduals
from . import pictures
from .page import Cell, Element, Section, figures, folded, heading, key, note, table
from .style import SERIES
from .words import count, listed, number, span

Array = NDArray[np.float64]

COLOURS = dict(zip(MODES, (SERIES[2], SERIES[0], SERIES[1]), strict=True))
ENGINE = {
    "mujoco": "MuJoCo (MJCF)",
    "mujoco (URDF)": "MuJoCo (URDF)",
    "pinocchio": "Pinocchio (URDF)",
    "yourdfpy": "yourdfpy (URDF)",
}
# What the conventions for descriptions ask for [m].
AGREEMENT_M = 1e-9
KEY = {
    "measured": ("c3", "driven by measured angles"),
    "encoder": ("c1", "driven by encoder counts alone"),
    "simulated": ("c2", "simulated in MuJoCo from encoder counts"),
}


def by_finger(residuals: Residuals) -> dict[str, list[TrialResiduals]]:
    """Finger -> its replayed trials, in the order of the hand."""
    found: dict[str, list[TrialResiduals]] = {}
    for trial in residuals.trials:
        found.setdefault(trial.finger, []).append(trial)
    return found


def distances_mm(trials: list[TrialResiduals], mode: str, **where: str) -> Array:
    """Marker errors (q,) [mm] of several trials, those that were replayed in this mode."""
    return 1e3 * np.concatenate(
        [np.zeros(0), *(t.distance_m(mode, **where) for t in trials if mode in t.residual_palm)]
    )


def noise_ratio(trials: list[TrialResiduals], mode: str, segment: str | None = None) -> float:
    """Root mean square error over that of noise alone, all trials together; nan where the mode was not replayed."""
    error = noise = 0.0
    for t in trials:
        if mode in t.residual_palm:
            mask = t.seen & np.array([segment in (None, s) for s in t.segment])
            error += float(np.sum(t.residual_palm[mode][mask] ** 2))
            noise += float(np.sum(t.noise_m[mask] ** 2))
    return float(np.sqrt(error / noise)) if noise else float("nan")


def best_mode(residuals: Residuals) -> str:
    """What the error is stated for: the encoder alone, or measured angles where no log was replayed."""
    return "encoder" if any("encoder" in t.residual_palm for t in residuals.trials) else "measured"


def trials_words(residuals: Residuals) -> str:
    """`6 trials that took no part in the fit`."""
    held = sum(t.held_out for t in residuals.trials)
    if held == len(residuals.trials):
        return f"{count(held, 'trial')} that took no part in the fit"
    if held == 0:
        return f"{count(len(residuals.trials), 'trial')} that the hand may have been fitted to"
    return f"{count(len(residuals.trials), 'trial')}, {held} of which took no part in the fit"


def error_section(residuals: Residuals) -> Section:
    """Marker error per finger, segment, marker, mode and phase."""
    fingers = by_finger(residuals)
    modes = [m for m in MODES if any(m in t.residual_palm for t in residuals.trials)]
    mode = best_mode(residuals)
    markers = [(name, _boxes(trials, modes, "label")) for name, trials in fingers.items()]
    phases = [(name, _boxes(trials, modes, "phase")) for name, trials in fingers.items()]
    top = 1.05 * max(float(np.max(v)) for _, g in markers for series in g.values() for v in series.values() if len(v))
    colours = {m: COLOURS[m] for m in modes}
    label = "marker error [mm]"
    body: list[Element] = [
        key(*[KEY[m] for m in modes]),
        figures(*[(f"{name}, per marker", pictures.boxes(g, label, colours, top)) for name, g in markers]),
        note(
            "In the form of figures 4.5 and 4.6: box from quartile to quartile, median in it, whiskers over the "
            "whole range. "
            "With measured angles the pose is fitted to these markers too"
            + (
                "; the other two place the palm by its own markers and know nothing of the finger's."
                if modes[1:]
                else "."
            )
        ),
        _segment_table(fingers, mode),
        *_others(residuals, fingers, modes, mode),
        heading("Per phase of the motion"),
        figures(*[(name, pictures.boxes(g, label, colours, top)) for name, g in phases]),
        _phase_table(fingers, mode),
    ]
    return Section("error", "Marker error of the replay", _error_words(residuals, fingers, mode), tuple(body))


def _boxes(trials: list[TrialResiduals], modes: list[str], by: str) -> dict[str, dict[str, Array]]:
    groups = list(dict.fromkeys(label for t in trials for label in t.labels)) if by == "label" else list(PHASES)
    return {_short(g): {m: distances_mm(trials, m, **{by: g}) for m in modes} for g in groups}


def _short(name: str) -> str:
    return name.split(":")[-1]


def _error_words(residuals: Residuals, fingers: dict[str, list[TrialResiduals]], mode: str) -> str:
    middle = {
        name: float(np.median(distances_mm(trials, mode)))
        for name, trials in fingers.items()
        if len(distances_mm(trials, mode))
    }
    ratio = {name: noise_ratio(fingers[name], mode) for name in middle}
    worst = max(ratio, key=lambda name: ratio[name])
    how = "Driven by encoder counts alone" if mode == "encoder" else "Driven by the measured angles"
    words = (
        f"{how}, on {trials_words(residuals)}, the median marker error is "
        f"{span(list(middle.values()), unit='mm')}{' per finger' if len(middle) > 1 else ''}"
    )
    if mode == "encoder":
        words += f", {number(ratio[worst])} times what marker noise alone gives at worst ({worst})"
        side = residuals.description.side
        low, high = (1e3 * v for v in MARKER_ERROR_M.get(side, (np.nan, np.nan)))
        if any(name in ("thumb_0", "thumb_1", "index", "middle", "ring", "little") for name in fingers) and np.isfinite(
            high
        ):
            words += (
                f"; the thesis reports {f'about {low:.0f} to' if low else 'up to'} {high:.0f} mm for its {side} hand"
            )
    return words + "."


def _segment_table(fingers: dict[str, list[TrialResiduals]], mode: str) -> Element:
    rows: list[list[str | Cell]] = []
    for name, trials in fingers.items():
        for segment in dict.fromkeys(s for t in trials for s in t.segment):
            values = distances_mm(trials, mode, segment=segment)
            if len(values):
                cells = [
                    number(float(v))
                    for v in (np.median(values), *np.quantile(values, [0.25, 0.75]), values.min(), values.max())
                ]
                ratio = number(noise_ratio(trials, mode, segment)) if mode != "measured" else "–"
                rows.append([name, segment, *cells, ratio, Cell(str(len(values)), "dim")])
    columns = ["finger", "segment", "median", "25 %", "75 %", "least", "most", "over noise", "values"]
    return table(columns, rows, f"Marker error [mm], {KEY[mode][1]}", text_columns=2)


def _others(
    residuals: Residuals, fingers: dict[str, list[TrialResiduals]], modes: list[str], shown: str
) -> list[Element]:
    """What the other ways to drive the model give, and how far the simulation is from the kinematics."""
    out: list[Element] = []
    both = [t for t in residuals.trials if "simulated" in t.residual_palm]
    if both:
        apart = [
            np.nanmax(np.linalg.norm(t.residual_palm["simulated"] - t.residual_palm["encoder"], axis=-1)[t.seen])
            for t in both
            if t.seen.any()
        ]
        out.append(
            note(
                "Simulated with only the proximal joint driven, the linkages' equalities put every marker within "
                f"{1e3 * max(apart):.1g} mm of "
                "where the encoder maps put it: the file moves as the hand was identified to."
                if max(apart) < 1e-4
                else f"Simulated with only the proximal joint driven, markers end up to {1e3 * max(apart):.2g} mm "
                "from where the encoder maps put them."
            )
        )
    for mode in modes:
        if mode != shown:
            out.append(folded(f"The same table, {KEY[mode][1]}", _segment_table(fingers, mode)))
    return out


def _phase_table(fingers: dict[str, list[TrialResiduals]], mode: str) -> Element:
    rows = []
    for name, trials in fingers.items():
        cells: list[str | Cell] = [name]
        for phase in PHASES:
            values = distances_mm(trials, mode, phase=phase)
            cells += (
                [number(float(np.median(values))), number(float(np.quantile(values, 0.75)))]
                if len(values)
                else ["–", "–"]
            )
        rows.append(cells)
    columns = ["finger", *["median", "75 %"] * len(PHASES)]
    return table(columns, rows, f"Marker error [mm], {KEY[mode][1]}", [("", 1), *[(p, 2) for p in PHASES]])


def map_pictures(residuals: Residuals) -> tuple[Element, ...]:
    """Encoder maps with the angles of the replayed trials."""
    drawn = []
    for name, trials in by_finger(residuals).items():
        finger = residuals.description.hand.finger(name)
        if finger.encoder_maps and any(np.isfinite(t.counts).any() for t in trials):
            drawn.append((name, pictures.encoder_map(finger, trials)))
    if not drawn:
        return ()
    return figures(*drawn), note(
        f"Lines: the maps as fitted. Points: angles that the markers show in the {trials_words(residuals)}, thinned "
        "evenly along the range; below, "
        "what the map leaves of them."
    )


def clock_section(residuals: Residuals) -> Section | None:
    """Synchronisation of log and markers; None without a log."""
    trials = [t for t in residuals.trials if t.clock is not None]
    if not trials:
        return None
    fitted = residuals.description.hand.extra.get("clock", {})
    rows: list[list[str | Cell]] = [
        _clock_row(t.trial.name, vars(t.clock) | {"rate_free": t.clock.rate_free}, "replayed") for t in trials
    ]
    rows += [_clock_row(name, row, "fitted") for name, row in fitted.items()]
    sd = 1e3 * max(t.clock.offset_sd_s for t in trials)
    least = min(t.clock.explained for t in trials)
    drifting = [t.trial.name for t in trials if t.clock.rate != 1.0]
    rates = (
        f"{listed(drifting)}: the log's clock runs at another rate" if drifting else "the two clocks run at one rate"
    )
    words = (
        f"Log and markers are aligned to {number(sd, 1)} ms or better, the encoder explains at least "
        f"{number(100 * least, 2)} % of the angle's variance, and {rates}."
    )
    drawn = [("Correlation over the lag, every trial", pictures.correlation(trials))]
    for trial in trials:
        finger = residuals.description.hand.finger(trial.finger)
        if finger.encoder_maps:
            drawn.append((f"{trial.trial.name}, the fastest four seconds", pictures.overlay(finger, trial)))
    columns = ["trial", "", "offset [s]", "± ms", "rate − 1 [ppm]", "± ppm", "explained [%]"]
    body = (
        key(("c1", "angle from the markers"), ("ink", "aligned encoder through its map")),
        figures(*drawn),
        table(columns, rows, "log time = offset + rate × mocap time", text_columns=2),
        note(
            "Correlation finds the offset to one sample, least squares through the encoder map refines it; a rate "
            "is used where it differs from 1 by more than four standard deviations."
        ),
    )
    return Section("clocks", "Synchronisation", words, body)


def _clock_row(name: str, clock: dict, use: str) -> list[str | Cell]:
    drift = clock["rate"] != 1.0
    return [
        name,
        Cell(use, "dim"),
        number(clock["offset_s"], 4),
        number(1e3 * clock["offset_sd_s"], 2),
        Cell(number(1e6 * (clock["rate_free"] - 1), 0), "best" if drift else "dim"),
        Cell(number(1e6 * clock["rate_sd"], 0), "dim"),
        number(100 * clock["explained"], 3),
    ]


def engines_section(residuals: Residuals) -> Section:
    """Agreement of the engines with this project's own forward kinematics."""
    distance = {ENGINE.get(name, name): value for name, value in residuals.agreement_m.items()}
    worst = max(distance, key=lambda name: distance[name])
    verdict = "agree" if distance[worst] <= AGREEMENT_M else "do not agree"
    words = (
        f"{listed(list(distance))} {verdict} with this project's own forward kinematics: at most "
        f"{distance[worst]:.1e} m "
        f"apart ({worst}) at any marker or tip, over {AGREEMENT_POSES} random poses of each file (limit "
        f"{AGREEMENT_M:.0e} m)."
    )
    rows = [
        [name, Cell(f"{value:.1e}", "fine" if value <= AGREEMENT_M else "flag")] for name, value in distance.items()
    ]
    return Section("engines", "Engines", words, (table(["engine", "largest distance [m]"], rows),))
