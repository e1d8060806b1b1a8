"""Effects that the table does not know, never resized. Forces and currents in raw units, positions in %, times in s,
`begin` as a share of each trial."""

from __future__ import annotations

from .draw import Drawn, Site, of_motor


def noise_bursts(site: Site) -> Drawn:
    """A current whose noise comes in bursts."""
    form = site.form
    bursts = (form.between("factor", 3, 5), form.between("length", 0.2, 0.8), form.between("share", 0.15, 0.35))
    figures = {"factor": bursts[0], "length_s": bursts[1], "share": bursts[2]}
    return Drawn(log={"bursts": bursts}, figures=figures)


def current_gain_change(site: Site) -> Drawn:
    """A current whose reading changes its gain during each trial."""
    form = site.form
    step = (form.between("begin", 0.3, 0.7), 1 + form.sign("sign") * form.between("change", 0.12, 0.25))
    return Drawn(log={"gain_step": step}, figures={"begin": step[0], "gain": step[1]})


def intermittent_stick(site: Site) -> Drawn:
    """Friction that grows now and then, after some travel."""
    return of_motor(
        sticking=site.form.between("share", 0.5, 1.0),
        sticking_period=site.form.between("period", 15, 35),
        sticking_length=site.form.between("length", 4, 9),
    )


def rest_posture_change(site: Site) -> Drawn:
    """A finger that sits differently on its drive from some time of each trial on."""
    form = site.form
    jump = (form.between("begin", 0.3, 0.7), form.sign("sign") * form.between("angle", 0.02, 0.05))
    return Drawn(linkage={"rest_jump": jump}, figures={"begin": jump[0], "angle_rad": jump[1]})


def controller_retuned(site: Site) -> Drawn:
    """A controller whose gain is changed during each trial."""
    retuned = (site.form.between("begin", 0.3, 0.6), site.form.between("factor", 0.35, 0.6))
    return Drawn(log={"retuned": retuned}, figures={"begin": retuned[0], "factor": retuned[1]})


def friction_of_acceleration(site: Site) -> Drawn:
    """Friction that grows with the acceleration."""
    return of_motor(acceleration_friction=site.form.between("friction", 0.02, 0.05))


def lubricant_migration(site: Site) -> Drawn:
    """Viscous friction that falls in motion and comes back at rest."""
    return of_motor(lubricant=site.form.between("share", 0.8, 1.8), lubricant_time=site.form.between("time", 2, 8))


def encoder_missed_counts(site: Site) -> Drawn:
    """An encoder that loses counts in every fast move."""
    missed = site.form.between("counts", 8, 22)
    return Drawn(log={"missed_counts": missed}, figures={"per_fast_move": missed})


def occlusion_bias(site: Site) -> Drawn:
    """Markers that shift now and then, as where fewer cameras see them."""
    occlusion = (site.form.between("shift", 0.6, 1.5), site.form.between("share", 0.1, 0.3))
    return Drawn(markers={"occlusion": occlusion}, figures={"shift_mm": occlusion[0], "share": occlusion[1]})


def mocap_scale_drift(site: Site) -> Drawn:
    """Cameras whose scale drifts over each trial."""
    scale = site.form.sign("sign") * site.form.between("scale", 0.006, 0.015)
    return Drawn(markers={"scale_drift": scale}, figures={"scale": scale})


def supply_fluctuation(site: Site) -> Drawn:
    """A supply that swings the motor's force."""
    return of_motor(supply_swing=site.form.between("share", 0.15, 0.35), supply_hz=site.form.between("hertz", 0.3, 2.0))


def motor_crosstalk(site: Site) -> Drawn:
    """Another motor's current in the reading."""
    crosstalk = (site.form.between("amplitude", 6, 14), site.form.between("period", 1.5, 5))
    return Drawn(log={"crosstalk": crosstalk}, figures={"amplitude": crosstalk[0], "period_s": crosstalk[1]})


def wandering_friction(site: Site) -> Drawn:
    """Friction that walks at random."""
    return of_motor(wandering=site.form.between("share", 0.06, 0.12))


def dwell_ageing(site: Site) -> Drawn:
    """Friction that grows at rest."""
    return of_motor(ageing=site.form.between("share", 0.3, 0.6))


def travel_load(site: Site) -> Drawn:
    """A load that is periodic in the distance travelled."""
    return of_motor(travel_load=site.form.between("load", 8, 14), travel_period=site.form.between("period", 30, 160))


def preload_jump(site: Site) -> Drawn:
    """A preload that jumps during each trial."""
    form = site.form
    jump = (form.between("begin", 0.3, 0.7), form.sign("sign") * form.between("force", 9, 18))
    return Drawn(log={"preload_jump": jump}, figures={"begin": jump[0], "force": jump[1]})


def current_offset_drift(site: Site) -> Drawn:
    """A current whose zero swings slowly."""
    form = site.form
    swing = (form.between("amplitude", 6, 12), form.between("period", 11, 45), form.between("phase", 0, 6.28))
    figures = {"amplitude": swing[0], "period_s": swing[1], "phase_rad": swing[2]}
    return Drawn(log={"offset_swing": swing}, figures=figures)


def running_vibration(site: Site) -> Drawn:
    """A load that vibrates in motion."""
    return of_motor(vibration=site.form.between("load", 14, 26), vibration_hz=site.form.between("hertz", 3, 8))
