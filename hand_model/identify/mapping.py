"""Encoder counts to joint angles, and the linkage between the joints of a finger."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..hand import Coupling, EncoderMap
from ..session import between_rows
from .finger import FingerFit
from .polynomial import cycles, fit_polynomial

Array = NDArray[np.float64]

ENCODER_ORDERS = (1, 2, 3)
COUPLING_ORDERS = (1, 2, 3, 4)


@dataclass(frozen=True)
class Aligned:
    """Joint angles and what drives them at common instants. counts: (n,), nan without a log. angle_rad: (n, k). cycle:
    (n,)."""

    counts: Array
    angle_rad: Array
    cycle: NDArray[np.int64]


def aligned(fit: FingerFit) -> Aligned:
    """Sound frames of all flexion trials, with the counts that the log had at those instants (linear between
    samples)."""
    counts = np.full(len(fit.fit.pose.angle_rad), np.nan)
    cycle = np.zeros(len(counts), int)
    for record in fit.records:
        drive = fit.fit.pose.angle_rad[record.frames, 0]
        if record.log is not None and record.clock is not None:
            counts[record.frames] = counts_at(
                record.log.time_s, record.log.column("position"), record.clock.log_time(record.mocap.time_s)
            )
            drive = np.where(
                np.isfinite(counts[record.frames]), counts[record.frames], np.nanmedian(counts[record.frames])
            )
        cycle[record.frames] = cycles(drive) + cycle.max() + 1
    good = fit.good & (np.isfinite(counts) if fit.records[0].log is not None else True)
    return Aligned(counts[good], fit.fit.pose.angle_rad[good], cycle[good])


def counts_at(log_time_s: Array, counts: Array, time_s: Array) -> Array:
    """Encoder counts (n,) at log times (n,) [s]: linear between samples, nan outside the log and across lost
    stretches."""
    kept = np.isfinite(counts) & np.isfinite(log_time_s)
    s, c = log_time_s[kept], counts[kept]
    return np.where(between_rows(s, time_s), np.interp(time_s, s, c), np.nan)


def encoder_maps(fit: FingerFit, data: Aligned) -> tuple[EncoderMap, ...]:
    """One map per joint, counts to angle [rad]; empty without a log. Zero of the scale is rest, one the recorded
    maximum."""
    if not np.isfinite(data.counts).any():
        return ()
    at_rest = [
        r.log.column("position")[r.log.time_s < r.clock.log_time(np.array([1.0]))[0]]
        for r in fit.records
        if r.log and r.clock
    ]
    low, high = np.nanquantile(data.counts, [0.001, 0.999])
    rest = np.concatenate(at_rest)
    opened = float(np.nanmedian(rest)) if np.isfinite(rest).any() else float(low)
    closed = float(high if abs(high - opened) >= abs(low - opened) else low)
    u = (data.counts - opened) / (closed - opened)
    maps = []
    for k in range(data.angle_rad.shape[1]):
        found = fit_polynomial(u, data.angle_rad[:, k], data.cycle, ENCODER_ORDERS)
        maps.append(EncoderMap(opened, closed, found.coefficients, _text(found.rmse), _text(found.rmse_held_out)))
    return tuple(maps)


def couplings(fit: FingerFit, data: Aligned, maps: tuple[EncoderMap, ...]) -> tuple[Coupling, ...]:
    """Each further joint over the first, monotonic.

    Where there is a log the driver's angle is taken from its encoder map: markers' noise in the regressor would flatten
    the polynomial (attenuation; Fuller 1987, "Measurement error models", section 1.1).
    """
    names = [segment.name for segment in fit.finger.segments]
    driver = maps[0].angle_rad(data.counts) if maps else data.angle_rad[:, 0]
    found = []
    for k in range(1, data.angle_rad.shape[1]):
        polynomial = fit_polynomial(driver, data.angle_rad[:, k], data.cycle, COUPLING_ORDERS, monotonic=True)
        found.append(
            Coupling(
                names[0], names[k], polynomial.coefficients, _text(polynomial.rmse), _text(polynomial.rmse_held_out)
            )
        )
    return tuple(found)


def ranges(data: Aligned, maps: tuple[EncoderMap, ...], links: tuple[Coupling, ...]) -> list[tuple[float, float]]:
    """Recorded range (min, max) [rad] of each joint, free of marker noise: through map and linkage where there are
    any."""
    if not maps:
        return [tuple(np.quantile(angle, [0.005, 0.995]).tolist()) for angle in data.angle_rad.T]
    counts = np.linspace(*np.nanquantile(data.counts, [0.001, 0.999]), 200)
    driver = maps[0].angle_rad(counts)
    angles = [driver] + [link.follower_rad(driver) for link in links]
    return [(float(a.min()), float(a.max())) for a in angles]


def _text(table: dict[int, float]) -> dict[str, float]:
    return {str(order): value for order, value in table.items()}
