"""Effects of load. Forces in raw units of current, positions in %, times in s."""

from __future__ import annotations

import numpy as np

from ..geometry import across, unit
from ..hidden import Contact
from .draw import Drawn, Site, of_motor


def detent_load(site: Site) -> Drawn:
    """A bump of the load, or a hill to get over."""
    return of_motor(
        detent=site.size * site.form.sign("sign") * site.form.between("load", 14, 28),
        detent_centre=site.form.between("centre", 25, 75),
        detent_width=site.form.between("width", 4, 9),
        detent_form=float(site.form.index("form", 2)),
    )


def nonlinear_spring(site: Site) -> Drawn:
    """A cubic or a square part of the spring."""
    form = site.form
    if form.index("form", 2):
        force = form.keep("cubic", lambda: form.sign("sign") * float(form.rng.uniform(18, 40)))
        return of_motor(cubic_spring=site.size * force)
    force = form.keep("square", lambda: form.sign("sign") * float(form.rng.uniform(22, 45)))
    return of_motor(square_spring=site.size * force)


def gravity_load(site: Site) -> Drawn:
    """The finger's weight, as the hand is held."""
    hand = site.session.hand
    axis = hand.turned @ site.finger.axes[0]
    down = unit(hand.gravity)
    lever = hand.turned @ across(site.finger.axes[0])[0]
    open_moment = axis @ np.cross(lever, down)
    turned_moment = axis @ np.cross(np.cross(axis, lever), down)
    phase = float(np.arctan2(open_moment, turned_moment))
    share = float(np.hypot(open_moment, turned_moment))
    weight = -site.size * site.form.between("weight", 45, 90) * max(share, 0.4)
    changes = {"weight": weight, "weight_phase": phase, "full_angle": site.finger.full_angles[0]}
    return Drawn(motor=changes, figures={"weight": weight, "phase_rad": phase})


def torque_ripple(site: Site) -> Drawn:
    """A load that is periodic in position."""
    return of_motor(
        ripple=site.size * site.form.between("load", 7, 15),
        ripple_period=site.form.between("period", 4, 14),
        ripple_phase=site.form.between("phase", 0, 6.28),
    )


def viscoelastic_spring(site: Site) -> Drawn:
    """A second spring that relaxes."""
    return of_motor(
        relaxing_stiffness=site.size * site.form.between("stiffness", 0.15, 0.4),
        relaxation_time=site.form.between("time", 0.4, 4),
    )


def end_stop_contact(site: Site) -> Drawn:
    """A soft stop before the end of the range."""
    stop = site.form.between("stop", 78, 92)
    return of_motor(stop=stop, stop_stiffness=site.size * site.form.between("stiffness", 2.0, 6.0))


def external_contact(site: Site) -> Drawn:
    """Something that stands in the finger's way for a while."""
    form = site.form
    place = form.between("place", 45, 75)
    stiffness = site.size * form.between("stiffness", 0.8, 2.0)
    give = site.size * form.between("give", 0.0015, 0.004)
    span = (form.between("begin", 0.0, 0.3), form.between("end", 0.6, 1.0))
    drawn = form.keep("trials", lambda: [bool(each) for each in form.rng.random(8) < 0.7])
    contact = Contact(place, stiffness, give, span, (True, *drawn[1:]))
    figures = {"place": place, "stiffness": stiffness, "give_rad_per_pct": give, "share_of_trial": span}
    return Drawn(log={"contact": contact}, figures=figures)
