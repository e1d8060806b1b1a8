/* One drive on the way of its reference: trapezoid, position and speed controller, LuGre friction, load.
   Position in % of the range, force in raw units of current, time in s. parameters.h is written from motor.Motor. */
#include <math.h>
#include "parameters.h"

#define NOISE 60000 /* numbers given */
#define TAU (2 * M_PI)
#define COLUMNS 7

struct state {
  double position, speed, acceleration;
  double bristle;             /* deflection of the friction's bristle [%] */
  double reference, reference_speed;
  double relaxed;             /* where the relaxing spring is at rest [%] */
  double plastic;             /* share of the hysteresis' load, -1 to 1 */
  double travelled;           /* [%] */
  double walk;                /* of the friction, share */
  double still;               /* time at rest, fading in motion [s] */
  double spread;              /* lubricant spread by motion */
};

static double bell(double y) { return exp(-0.5 * y * y); }

static double spring(const struct parameters *p, double x) {
  return p->stiffness * x + p->preload + p->square_spring * (x / 100) * (x / 100) +
         p->cubic_spring * pow(x / 100, 3);
}

/* what friction grows to while sliding */
static double friction_level(const struct parameters *p, struct state *s, double load, double t, double h,
                             const double *noise, int step) {
  double v = s->speed;
  double level = p->coulomb + (p->static_friction - p->coulomb) * exp(-fabs(v / p->stribeck_speed));
  if (p->tight_spot != 0)
    level += p->tight_spot * p->coulomb * bell((s->position - p->tight_centre) / p->tight_width);
  if (p->coulomb_asymmetry != 0 && v < 0) level *= 1 + p->coulomb_asymmetry;
  level += p->load_friction * fabs(load);
  if (p->warming != 0) level *= 1 + p->warming * exp(-(p->begun_s + t) / p->warming_time);
  if (p->acceleration_friction != 0) level += p->acceleration_friction * fabs(s->acceleration);
  if (p->wandering != 0) {
    s->walk += noise[step % NOISE] * p->wandering * sqrt(h);
    level *= 1 + s->walk;
    if (level < 2) level = 2;
  }
  if (p->sticking != 0) {
    double phase = fmod(s->travelled + p->sticking_period * 0.37, p->sticking_period);
    int turn = (int)(s->travelled / p->sticking_period);
    if (noise[(turn * 7 + 11) % NOISE] > 0.3 && phase < p->sticking_length) level *= 1 + p->sticking;
  }
  if (p->ageing != 0) {
    if (fabs(v) < 0.5) s->still += h;
    else s->still *= exp(-h * fabs(v) / 2.0);
    level *= 1 + p->ageing * log(1 + s->still / 0.1);
  }
  return level;
}

static double friction(const struct parameters *p, struct state *s, double level, double h) {
  double slide = fabs(s->speed) * p->bristle_stiffness / level;
  double bristle = (s->bristle + h * s->speed) / (1 + h * slide);
  double rate = (bristle - s->bristle) / h;
  s->bristle = bristle;
  return p->bristle_stiffness * bristle + p->bristle_damping * rate;
}

static double viscous(const struct parameters *p, struct state *s, double h) {
  double viscous = p->viscous;
  if (p->viscous_asymmetry != 0 && s->speed < 0) viscous *= 1 + p->viscous_asymmetry;
  if (p->lubricant != 0) {
    s->spread += h * (fabs(s->speed) / 50.0 - s->spread) / p->lubricant_time;
    viscous *= 1 + p->lubricant * exp(-s->spread * 3);
  }
  return viscous;
}

/* everything but friction that the motor has to overcome */
static double whole_load(const struct parameters *p, struct state *s, double load, double damping, double t,
                         double h) {
  double x = s->position, v = s->speed;
  if (p->lost_spring != 0)
    load -= p->lost_spring * (p->stiffness * x + p->preload) * 0.5 * (1 - tanh((x - p->lost_below) / p->lost_width));
  load += damping * v + p->drag * v * fabs(v);
  if (p->detent != 0) {
    double y = (x - p->detent_centre) / p->detent_width;
    load += p->detent * (p->detent_form < 0.5 ? bell(y) : -1.6487 * y * bell(y));
  }
  if (p->weight != 0) load += p->weight * sin(p->full_angle * (x / 100) + p->weight_phase);
  if (p->ripple != 0) load += p->ripple * sin(TAU * x / p->ripple_period + p->ripple_phase);
  if (p->hysteresis != 0) {
    double slide = fabs(v) / p->hysteresis_distance;
    s->plastic = (s->plastic + h * v / p->hysteresis_distance) / (1 + h * slide);
    load += p->hysteresis * s->plastic;
  }
  if (p->relaxing_stiffness != 0) {
    s->relaxed += h * (x - s->relaxed) / p->relaxation_time;
    load += p->relaxing_stiffness * (x - s->relaxed);
  }
  if (p->stop_stiffness != 0 && x > p->stop) load += p->stop_stiffness * (x - p->stop);
  if (p->obstacle_stiffness != 0 && t >= p->obstacle_from_s && t <= p->obstacle_to_s && x > p->obstacle)
    load += p->obstacle_stiffness * (x - p->obstacle);
  if (p->vibration != 0) load += p->vibration * sin(TAU * p->vibration_hz * t) * (fabs(v) > 5);
  if (p->travel_load != 0) load += p->travel_load * sin(TAU * s->travelled / p->travel_period);
  if (p->preload_jump != 0 && t > p->preload_jump_s) load += p->preload_jump;
  return load;
}

static void advance_reference(const struct parameters *p, struct state *s, double target, double share,
                              double current, double h) {
  double top = p->top_speed * share;
  if (p->sag_of_speed != 0) {
    double left = 1 - p->sag_of_speed * fabs(current) / 100;
    if (left < 0.1) left = 0.1;
    top *= left;
  }
  double rest = target - s->reference, wanted = sqrt(2 * p->acceleration * fabs(rest));
  if (wanted > top) wanted = top;
  if (rest < 0) wanted = -wanted;
  if (fabs(rest) < 1e-4 && fabs(s->reference_speed) < p->acceleration * h * 2) {
    s->reference_speed = 0;
    s->reference = target;
    return;
  }
  double change = wanted - s->reference_speed;
  if (change > p->acceleration * h) change = p->acceleration * h;
  if (change < -p->acceleration * h) change = -p->acceleration * h;
  s->reference_speed += change;
  s->reference += s->reference_speed * h;
  if ((target - s->reference) * rest < 0) {
    s->reference = target;
    s->reference_speed = 0;
  }
}

/* moves: targets [%], shares of the top speed, starts [s]; a row of `out` every `every` steps of h [s]:
   position, speed, current, friction, reference, load without viscous friction, position that the encoder sees */
void simulate(const struct parameters *p, int moves, const double *targets, const double *shares, const double *starts,
              int steps, double h, int every, const double *noise, double *out) {
  struct state s = {0};
  int move = -1;
  double target = 0, share = 1;
  for (int i = 0; i <= steps; i++) {
    double t = i * h;
    while (move + 1 < moves && t >= starts[move + 1] + p->command_delay) {
      move++;
      target = targets[move];
      share = shares[move];
    }
    double gain = p->position_gain;
    if (p->retuned_s > 0 && t > p->retuned_s) gain *= p->retuned_gain;
    double seen = s.position;
    if (p->encoder_error != 0)
      seen = s.position + p->encoder_error * sin(TAU * s.position / p->encoder_period + p->encoder_phase);
    double current = gain * (s.reference - seen) + p->speed_gain * (s.reference_speed - s.speed);
    if (p->current_limit > 0) {
      if (current > p->current_limit) current = p->current_limit;
      if (current < -p->current_limit) current = -p->current_limit;
    }
    double held = spring(p, s.position);
    double rub = friction(p, &s, friction_level(p, &s, held, t, h, noise, i), h);
    double damping = viscous(p, &s, h);
    double load = whole_load(p, &s, held, damping, t, h);
    double force = current;
    if (p->sag_of_force != 0) force = current * (1 - p->sag_of_force * fabs(current) / 100);
    if (p->supply_swing != 0) force *= 1 + p->supply_swing * sin(TAU * p->supply_hz * (t + p->begun_s));
    if (i % every == 0) {
      double row[COLUMNS] = {s.position, s.speed, current, rub, s.reference, load - damping * s.speed, seen};
      for (int k = 0; k < COLUMNS; k++) *out++ = row[k];
    }
    s.acceleration = (force - rub - load) / p->mass;
    s.speed += h * s.acceleration / (1 + h / p->mass * (p->speed_gain + damping)); /* implicit in the damping */
    s.position += h * s.speed;
    s.travelled += fabs(s.speed) * h;
    advance_reference(p, &s, target, share, current, h);
  }
}
