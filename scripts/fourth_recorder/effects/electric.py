"""Effects of encoder, drive electronics and log. Currents in raw units, positions in %, times in s."""

from __future__ import annotations

from .draw import Drawn, Site, of_motor

NOT_MEASURED = ("position_reference", "position_setpoint", "current_dead", "current_command")


def encoder_periodic_error(site: Site) -> Drawn:
    """An encoder whose error is periodic in position."""
    low, high = site.finger.counts
    period = site.form.between("period", 300, 1500)
    amplitude = site.size * site.form.between("amplitude", 14, 40)
    phase = site.form.between("phase", 0, 6.28)
    changes = {
        "encoder_error": amplitude / (high - low) * 100,
        "encoder_period": period / (high - low) * 100,
        "encoder_phase": phase,
    }
    figures = {"amplitude_counts": amplitude, "period_counts": period, "phase_rad": phase}
    return Drawn(motor=changes, figures=figures)


def drive_sag(site: Site) -> Drawn:
    """A drive that delivers ever less of a higher current, or moves slower with it."""
    form = site.form
    if form.index("form", 2):
        return of_motor(sag_of_force=site.size * form.between("force", 0.15, 0.35))
    return of_motor(sag_of_speed=site.size * form.between("speed", 0.12, 0.3))


def command_delay(site: Site) -> Drawn:
    """A drive that obeys late."""
    return of_motor(command_delay=site.size * site.form.between("delay", 0.06, 0.2))


def current_saturation(site: Site) -> Drawn:
    """A current that clips, in its reading or in the drive: there below what full speed needs, above what standing
    needs."""
    motor = site.finger.motor
    in_reading = site.form.index("form", 2)
    standing = motor.coulomb + 97 * motor.stiffness + motor.preload
    running = standing + site.session.laboratory.top_speed * motor.viscous
    if in_reading:
        level = running * (1 - site.size * site.form.between("share", 0.12, 0.25))
        return Drawn(log={"reading_limit": level}, figures={"clips": "reading", "level": level})
    level = running - min(site.size * site.form.between("depth", 0.35, 0.7), 0.85) * (running - standing)
    return Drawn(motor={"current_limit": level}, figures={"clips": "drive", "level": level})


def current_channel_delay(site: Site) -> Drawn:
    """A current that is logged late or early against the position."""
    delay = site.size * site.form.sign("sign") * site.form.between("delay", 0.02, 0.06)
    return Drawn(log={"current_delay": delay}, figures={"current_late_s": delay})


def command_as_measurement(site: Site) -> Drawn:
    """A column of the log that was never measured."""
    dead = NOT_MEASURED[site.form.index("form", 4)]
    return Drawn(log={"dead": dead}, figures={"form": dead})


def clock_drift(site: Site) -> Drawn:
    """A log whose clock runs fast or slow."""
    skew = 1 + site.size * site.form.sign("sign") * site.form.between("rate", 0.0007, 0.002)
    return Drawn(log={"skew": skew}, figures={"skew": skew})
