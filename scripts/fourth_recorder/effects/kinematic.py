"""Effects of joints and linkage. Angles in rad, lengths in mm, positions in %."""

from __future__ import annotations

from dataclasses import asdict

from ..hidden import MovingCentre, Wobble
from .draw import Drawn, Site, of_linkage


def drive_backlash(site: Site) -> Drawn:
    """A gap between motor and proximal joint."""
    return of_linkage(drive_play=site.size * site.form.between("half_gap", 0.012, 0.028))


def series_elasticity(site: Site) -> Drawn:
    """A drive that yields under load."""
    return of_linkage(drive_compliance=site.size * site.form.between("compliance", 0.0006, 0.0013))


def linkage_backlash(site: Site) -> Drawn:
    """A gap between proximal and distal joint."""
    return of_linkage(linkage_play=site.size * site.form.between("half_gap", 0.012, 0.03))


def linkage_compliance(site: Site) -> Drawn:
    """A linkage that yields under load."""
    return of_linkage(linkage_compliance=site.size * site.form.between("compliance", 0.0007, 0.0015))


def coupling_deadband(site: Site) -> Drawn:
    """A distal joint that starts late."""
    return of_linkage(deadband=site.size * site.form.between("angle", 0.1, 0.22))


def distal_stop(site: Site) -> Drawn:
    """A distal joint that stops early."""
    return of_linkage(distal_limit=1 - site.size * site.form.between("share", 0.1, 0.22))


def spring_decoupling(site: Site) -> Drawn:
    """A joint that leaves its motor, and the spring with it, below a place."""
    below, width = site.form.between("below", 15, 35), site.form.between("width", 1.5, 4)
    angle = site.size * site.form.between("angle", 0.06, 0.15)
    share = site.size * site.form.between("share", 0.5, 0.9)
    return Drawn(
        motor={"lost_spring": share, "lost_below": below, "lost_width": width},
        linkage={"lost_angle": angle, "lost_below": below, "lost_width": width},
        figures={"angle": angle, "below": below, "width": width, "spring_share": share},
    )


def joint_wobble(site: Site) -> Drawn:
    """A joint whose axis tilts to and fro."""
    form = site.form
    wobble = Wobble(
        joint=form.index("joint", 2),
        angle=site.size * form.between("angle", 0.025, 0.06),
        direction=form.between("direction", 0, 6.28),
        waves=form.between("waves", 2.0, 6.0),
        phase=form.between("phase", 0, 6.28),
    )
    return Drawn(linkage={"wobble": wobble}, figures=asdict(wobble), joint=wobble.joint)


def moving_centre(site: Site) -> Drawn:
    """A joint whose centre travels."""
    form = site.form
    centre = MovingCentre(
        joint=form.index("joint", 2),
        distance=site.size * form.sign("sign") * form.between("distance", 1.2, 2.8),
        direction=form.between("direction", 0, 6.28),
        bow=form.between("bow", -0.5, 0.5),
    )
    return Drawn(linkage={"moving_centre": centre}, figures=asdict(centre), joint=centre.joint)
