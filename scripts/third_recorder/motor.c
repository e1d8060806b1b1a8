/* Forward simulation of one drive: four controllers, a spring, friction with bristles, and whatever is hidden.
   Position in % of the range, force in raw units of the motor current, time in seconds.

   The order of every sum is part of what a seed means: another order rounds otherwise. */
#include <math.h>

#include "parameters.h" /* struct parameters, written by motor.py from its dataclass */

#define PI 3.14159265358979323846
#define BOTTOM (-2.0) /* hard end below the range */
#define COLUMNS 6

typedef const struct parameters *settings;

enum controller { CASCADE, TRAPEZOID, RAMP, BANG };

/* What acts from outside, one value per step. */
struct inputs {
  const double *target, *speed_share, *external, *touching, *gravity_dorsal, *gravity_along, *pushed_to;
};

struct state {
  double position, speed, bristle, hysteresis, relaxed, current;
  double integral, reference, reference_speed, slow_current; /* of the controller */
  int driving;
  int stroke; /* strokes begun */
  double direction, rest_s, moving_s, rest_age; /* of the last stroke; rest_age: 0 to 1, grows with the rest before it */
};

static double sign(double x) { return (x > 0) - (x < 0); }

static double clamp(double x, double limit) {
  if (x > limit) return limit;
  return x < -limit ? -limit : x;
}

static double bump(double x, double centre, double width) {
  double u = (x - centre) / width;
  return u < -1 || u > 1 ? 0 : 0.5 * (1 + cos(PI * u));
}

static double detent_shape(double x, double centre, double width, double form) {
  double u = (x - centre) / width;
  if (u < -1 || u > 1) return 0;
  return form < 0.5 ? 0.5 * (1 + cos(PI * u)) : sin(PI * u) * (1 - u * u);
}

/* A stiffening curve or a knee over 0 to 1, less its straight line. */
static double bent(double x, double form, double shape, double offset, double slope) {
  double e = x - shape;
  double y = form < 0.5 ? (exp(shape * x) - 1) / (exp(shape) - 1) : 0.5 * (e + sqrt(e * e + 0.0016));
  return y - offset - slope * x;
}

/* Speed loop within a position loop; it stops to integrate where the motor has come to rest at its target. */
static double cascade(settings q, struct state *s, double seen, double target, double top_speed, double dt) {
  double error = target - seen;
  double wanted = clamp(q->position_gain * error, top_speed);
  s->reference_speed += clamp(wanted - s->reference_speed, q->acceleration * dt);
  double speed_error = s->reference_speed - s->speed;
  if (!(fabs(error) < 0.35 && fabs(s->speed) < 0.6)) s->integral += q->integral_gain * speed_error * dt;
  s->integral = clamp(s->integral, 150);
  return q->speed_gain * speed_error + s->integral;
}

/* Reference with bounded acceleration (trapezoid) or none (ramp), followed with a model's current fed forward. */
static double follow(settings q, struct state *s, double seen, double target, double top_speed, double dt) {
  double left = target - s->reference, acceleration = 0;
  if ((int)q->controller == TRAPEZOID) {
    double stopping = sqrt(2 * q->acceleration * fabs(left)) * 0.98;
    double wanted = (stopping < top_speed ? stopping : top_speed) * sign(left);
    double change = clamp(wanted - s->reference_speed, q->acceleration * dt);
    s->reference_speed += change;
    acceleration = change / dt;
    s->reference += s->reference_speed * dt;
    if (fabs(target - s->reference) < 0.02 && fabs(s->reference_speed) < 2) {
      s->reference = target;
      s->reference_speed = acceleration = 0;
    }
  } else if (fabs(left) <= top_speed * dt) {
    s->reference = target;
    s->reference_speed = 0;
  } else {
    s->reference += top_speed * dt * sign(left);
    s->reference_speed = top_speed * sign(left);
  }
  double error = s->reference - seen;
  if (fabs(error) > 0.4) s->integral += q->integral_gain * error * dt;
  s->integral = clamp(s->integral, 60);
  return q->position_gain * error + q->derivative_gain * (s->reference_speed - s->speed) + s->integral +
         q->feed_forward * (q->mass * acceleration + q->viscous * s->reference_speed +
                            q->coulomb * tanh(s->reference_speed / 2.0) + q->stiffness * s->reference + q->preload);
}

/* Drives at the commanded speed until it is near, then holds weakly; its own slow current makes up for the load. */
static double bang(settings q, struct state *s, double seen, double target, double top_speed, double dt) {
  double error = target - seen;
  if (fabs(error) > q->deadband) s->driving = 1;
  if (fabs(error) < 0.4 * q->deadband) s->driving = 0;
  double wanted = s->driving ? top_speed * sign(error) : 0;
  if (s->driving && fabs(error) * 8 < fabs(wanted)) wanted = sign(error) * fmax(fabs(error) * 8, 6.0);
  s->reference_speed += clamp(wanted - s->reference_speed, q->acceleration * dt);
  s->slow_current += (s->current - s->slow_current) * dt / 0.06;
  return q->drive_gain * (s->reference_speed - s->speed) + q->load_share * s->slow_current +
         (s->driving ? 0 : q->holding_gain * error);
}

/* What the motor must bring up besides friction and inertia [raw]. */
static double load(settings q, struct state *s, const struct inputs *in, long i, double dt) {
  double x = s->position, v = s->speed, angle = q->full_angle * x / 100;
  double lifted = in->pushed_to[i] > x ? 1 - exp(-(in->pushed_to[i] - x) / 1.0) : 0; /* the finger left its drive */
  double sum = (q->preload + q->stiffness * x) * (1 - lifted) + in->external[i] +
               q->bent_spring * bent(x / 100, q->bent_form, q->bent_shape, q->bent_offset, q->bent_slope) * (1 - lifted) +
               q->detent * detent_shape(x, q->detent_centre, q->detent_width, q->detent_form);
  sum += q->weight * (in->gravity_dorsal[i] * cos(angle) + in->gravity_along[i] * sin(angle));
  sum += q->ripple * sin(2 * PI * x / q->ripple_period + q->ripple_phase) +
         q->ripple_second * sin(4 * PI * x / q->ripple_period + 1.3 * q->ripple_phase);
  sum += q->drag * v * fabs(v);
  s->relaxed += (x - s->relaxed) * dt / q->relaxation_time;
  sum += q->relaxing_stiffness * (x - s->relaxed);
  if (x > q->upper_stop) sum += q->upper_stiffness * (x - q->upper_stop) + 0.004 * q->upper_stiffness * (v > 0 ? v : 0);
  if (x < q->lower_stop) sum += q->lower_stiffness * (x - q->lower_stop);
  if (in->touching[i] > 0 && x > q->obstacle) {
    double force = q->obstacle_stiffness * (x - q->obstacle) + q->obstacle_damping * v;
    if (force > 0) sum += force * in->touching[i];
  }
  sum += q->fast_spring * (x / 100 - 0.5) * v * v / (v * v + q->fast_spring_speed * q->fast_spring_speed);
  if (x < BOTTOM) sum += 20 * (x - BOTTOM);
  if (q->hysteresis != 0) {
    double step = v * dt;
    s->hysteresis += step * q->hysteresis / q->hysteresis_distance * (1 - s->hysteresis / q->hysteresis * sign(step));
    sum += s->hysteresis;
  }
  return sum;
}

/* Count strokes, and how long the motor rested before the one under way. */
static void count_strokes(settings q, struct state *s, double dt) {
  if (fabs(s->speed) > 4) {
    if (sign(s->speed) != s->direction) {
      s->direction = sign(s->speed);
      s->stroke++;
    }
    if (s->moving_s <= 0) s->rest_age = 1 - exp(-s->rest_s / q->ageing_rest);
    s->moving_s += dt;
    s->rest_s = 0;
  } else if (fabs(s->speed) < 1) {
    s->rest_s += dt;
    s->moving_s = 0;
  }
}

/* Dry friction [raw] through bristles that yield at its level. */
static double friction(settings q, struct state *s, double load, double time, double dt) {
  double v = s->speed, slowness = fabs(v) / q->stribeck_speed;
  double level = q->coulomb;
  level += q->stribeck_form < 0.5 ? q->stribeck * exp(-fabs(v) / q->stribeck_speed)
                                  : q->stribeck / (1 + slowness * slowness);
  level += q->load_friction * fabs(load) + q->tight_spot * bump(s->position, q->tight_centre, q->tight_width);
  level += q->warming * (1 - exp(-(q->warm_s + time) / q->warming_time));
  count_strokes(q, s, dt);
  if (s->stroke % 3 == 2) level += q->third_stroke;
  level += q->ageing * s->rest_age * exp(-s->moving_s / q->ageing_time);
  double flexing = level + q->coulomb_asymmetry, extending = level - q->coulomb_asymmetry;
  if (flexing < 1) flexing = 1;
  if (extending < 1) extending = 1;
  double bristle_stiffness = q->coulomb / q->breakaway;
  int sliding = 0;
  s->bristle += v * dt;
  if (s->bristle > flexing / bristle_stiffness) s->bristle = flexing / bristle_stiffness, sliding = 1;
  if (s->bristle < -extending / bristle_stiffness) s->bristle = -extending / bristle_stiffness, sliding = 1;
  double force = bristle_stiffness * s->bristle;
  /* stiff bristles are damped critically, or the motor would ring at rest */
  if (!sliding) force += (q->breakaway < 0.2 ? 2.0 * sqrt(bristle_stiffness * q->mass) : 0.5 * q->viscous) * v;
  return force;
}

/* Run `steps` steps of dt from rest; every `every`-th goes to `out`: position, speed, current, lift of the finger off
   its drive, friction, position as its encoder has it. */
void simulate(settings q, long steps, double dt, const struct inputs *in, double start, int every, double *out) {
  struct state s = {.position = start, .relaxed = start, .reference = start, .rest_s = 1.0};
  for (long i = 0; i < steps; i++) {
    long then = i - (long)(q->command_delay / dt);
    if (then < 0) then = 0;
    double target = in->target[then], top_speed = q->top_speed * in->speed_share[then];
    double seen = s.position + q->encoder_error * sin(2 * PI * s.position / q->encoder_period + q->encoder_phase);
    double (*control)(settings, struct state *, double, double, double, double) =
        (int)q->controller == CASCADE ? cascade : (int)q->controller == BANG ? bang : follow;
    s.current = clamp(control(q, &s, seen, target, top_speed, dt), q->current_limit);
    double delivered = s.current / (1 + fabs(s.current) * q->sag);
    double against = load(q, &s, in, i, dt);
    double rubbing = friction(q, &s, against, i * dt, dt);
    double viscous = q->viscous + (s.speed > 0 ? q->viscous_asymmetry : -q->viscous_asymmetry);
    s.speed += (delivered - against - viscous * s.speed - rubbing) / q->mass * dt;
    s.position += s.speed * dt;
    if (i % every == 0) {
      double lift = in->pushed_to[i] > s.position ? in->pushed_to[i] - s.position : 0;
      double row[COLUMNS] = {s.position, s.speed, s.current, lift, rubbing, seen};
      for (int k = 0; k < COLUMNS; k++) *out++ = row[k];
    }
  }
}
