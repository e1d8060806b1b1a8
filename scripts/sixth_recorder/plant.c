/* One finger's drive at a fixed step. Units: q in % of the range, v in %/s, loads in raw current.
 * plant.py writes the enum of the parameters P[...] in front of this text and says what they are. */
#include <math.h>

#define NQ 2401 /* tables over q: -10..110 %, step 0.05 */
#define NV 1601 /* tables over v: -200..200 %/s, step 0.25 */

enum {
    S_Q,
    S_V,
    S_INTEGRAL,
    S_HEAT,
    S_AGE,
    S_TRAVEL,
    S_BRISTLE,
    S_GAP,
    S_CURRENT,
    S_MAXWELL,
    S_IWAN = 12,
    S_BOUC_WEN = 28,
    S_RING_Q,
    S_RING_V,
    S_BUS,
    S_REFERENCE,
    S_FORWARD
};

static double look(const double *table, int n, double x, double x0, double h) {
    double s = (x - x0) / h;
    if (s < 0) s = 0;
    if (s > n - 1.001) s = n - 1.001;
    int i = (int)s;
    s -= i;
    return table[i] * (1 - s) + table[i + 1] * s;
}

static double over_q(const double *table, double q) { return look(table, NQ, q, -10, .05); }

static double over_v(const double *table, double v) { return look(table, NV, v, -200, .25); }

static double within(double x, double limit) {
    if (x > limit) x = limit;
    if (x < -limit) x = -limit;
    return x;
}

/* Reference x (%) and speed v (%/s) of a move over D from x0 that lasts total s, `phase` s after its beginning. */
static void reference(const double *P, double phase, double total, double D, double x0, double speed, double *x,
                      double *v) {
    if (P[PROF] < .5) { /* trapezoid of speed */
        double ramp = speed / P[ACC];
        if (ramp > total / 2) ramp = total / 2;
        double peak = fabs(D) / (total - ramp);
        double s, ds;
        if (phase < ramp) {
            s = .5 * peak / ramp * phase * phase;
            ds = peak * phase / ramp;
        } else if (phase < total - ramp) {
            s = peak * (phase - ramp / 2);
            ds = peak;
        } else {
            double left = total - phase;
            s = fabs(D) - .5 * peak / ramp * left * left;
            ds = peak * left / ramp;
        }
        double sign = D > 0 ? 1 : -1;
        *x = x0 + sign * s;
        *v = sign * ds;
    } else { /* minimum jerk */
        double u = phase / total;
        *x = x0 + D * (10 * u * u * u - 15 * u * u * u * u + 6 * u * u * u * u * u);
        *v = D / total * (30 * u * u - 60 * u * u * u + 30 * u * u * u * u);
    }
}

/* moves: n_moves rows of time (s), target (%), speed (%/s). Tables: load and friction over q, over v, load over the
 * share of the travel's period, encoder error over q (%). Series, one value per step: whether the obstacle is there,
 * factor of the friction, load. out: a row of q v a I friction heat target at every second step. */
void simulate(int n, double dt, const double *P, double *S, int n_moves, const double *moves, const double *load_q,
              const double *friction_q, const double *load_v, const double *friction_v, const double *load_travel,
              const double *encoder, const double *contact, const double *friction_factor, const double *extra,
              double *out) {
    double q = S[S_Q], v = S[S_V], integral = S[S_INTEGRAL], heat = S[S_HEAT], age = S[S_AGE];
    double travel = S[S_TRAVEL], z = S[S_BRISTLE], gap = S[S_GAP], I = S[S_CURRENT], bus = S[S_BUS];
    double forward = S[S_FORWARD];
    double v_ramp = 0, v_seen = v;
    double target = S[S_REFERENCE], speed = 50, x0 = target, x_last = target, phase = 1e9, D = 0, total = 1;
    double I_hold = I, q_before = q;
    int arrived = 1, move = 0;
    int every = (int)(P[TS] / dt + .5);
    if (every < 1) every = 1;
    for (int k = 0; k < n; k++) {
        double t = k * dt;
        while (move < n_moves && t >= moves[3 * move] + P[DELAY]) {
            x0 = target;
            target = moves[3 * move + 1];
            speed = moves[3 * move + 2];
            move++;
            arrived = 0;
            phase = 0;
            if (P[MODE] > 1.5) x0 = x_last;
            D = target - x0;
            total = P[PROF] < .5 ? fabs(D) / speed + speed / P[ACC] : 1.35 * fabs(D) / speed;
            if (total < .05) total = .05;
        }

        /* controller, at its own period h */
        if (k % every == 0) {
            double h = every * dt;
            double q_seen = q + over_q(encoder, q);
            double share = h / (h + .004);
            v_seen += share * (v - v_seen);
            double sag = 1;
            if (P[SAG] > 0) {
                double l = fabs(I) / P[PREF];
                if (P[SAGPOW] > 1.5) l = fabs(I * v) / (P[PREF] * 60);
                else if (P[SAGPOW] > .5) l = l * l;
                bus += (l - bus) * h / (P[SAGTAU] + h);
                sag = 1 - P[SAG] * bus;
                if (sag < .3) sag = .3;
            }
            if (P[MODE] < 1.5) { /* servo of speed */
                double error = target - q_seen;
                if (!arrived && fabs(error) < P[DB]) arrived = 1;
                double wanted = 0;
                if (!arrived) {
                    double limit = speed * sag;
                    double left = fabs(error) - P[DB] * .6;
                    if (left < 0) left = 0;
                    double w = P[MODE] < .5 ? sqrt(2 * .7 * P[ACC] * left) + 1.5 : P[KX] * fabs(error);
                    wanted = (error > 0 ? 1 : -1) * (w < limit ? w : limit);
                }
                v_ramp += within(wanted - v_ramp, P[ACC] * h);
                if (arrived && fabs(v_ramp) < 1e-9) v_ramp = 0;
                if (fabs(v_ramp) > .05) forward = P[FF] * P[FC] * tanh(v_ramp / 2);
                if (arrived && fabs(v) < .5 && P[HOLD] < 1.5) {
                    if (P[HOLD] > .5) I_hold *= exp(-h / .15);
                    I = I_hold;
                    integral = I - forward;
                    v_ramp = 0;
                } else {
                    double e = v_ramp - v_seen;
                    integral += P[KI] * e * h;
                    I = P[KP] * e + integral + forward;
                    I_hold = I;
                }
            } else { /* tracking of a reference */
                double x_ref, v_ref;
                phase += h * sag;
                if (phase >= total) {
                    x_ref = target;
                    v_ref = 0;
                } else {
                    reference(P, phase, total, D, x0, speed, &x_ref, &v_ref);
                    v_ref *= sag;
                }
                x_last = x_ref;
                double e = x_ref - q_seen;
                if (!(phase >= total && fabs(e) < P[DB])) integral += P[KI] * e * h;
                if (fabs(v_ref) > .05) forward = P[FF] * P[FC] * tanh(v_ref / 2);
                I = P[KX] * e + P[KP] * (v_ref - v_seen) + integral + forward;
                if (phase >= total && P[HOLD] > .5 && P[HOLD] < 1.5 && fabs(v) < .5 && fabs(e) < 3 * P[DB]) {
                    I_hold *= exp(-h / .15);
                    I = I_hold;
                    integral = I - forward - P[KX] * e;
                } else {
                    I_hold = I;
                }
            }
            if (I > P[ILIM] || I < -P[ILIM]) {
                double most = I > 0 ? P[ILIM] : -P[ILIM];
                integral -= .2 * (I - most);
                I = most;
            }
        }

        /* loads */
        double spring = P[K_] * q + P[TAU0] + over_q(load_q, q);
        double load = spring + over_v(load_v, v) + P[B_] * v + extra[k];
        if (P[SEAMP] > 0) {
            double turn = fmod(travel, P[SEAMP]) / P[SEAMP];
            load += load_travel[(int)(turn * 256) & 255];
        }
        if (contact[k] > 0 && q > P[CQ]) {
            double d = q - P[CQ];
            double f = P[CK] * pow(d, P[CN]) * (1 + P[CD] * v);
            load += f > 0 ? f * contact[k] : 0;
        }
        if (P[HCD] != 0) {
            double d = P[HCS] * (q - P[HCQ]);
            if (d > 0) load += P[HCD] * d * v;
        }
        double dq = q - q_before;
        q_before = q;
        for (int i = 0; i < 3; i++) {
            if (P[MX1 + 2 * i] == 0) continue;
            S[S_MAXWELL + i] += dq - S[S_MAXWELL + i] * dt / P[MXT1 + 2 * i];
            load += P[MX1 + 2 * i] * S[S_MAXWELL + i];
        }
        int sliders = (int)P[NIW];
        for (int i = 0; i < sliders; i++) {
            double d = P[IWD] * (2.0 * (i + 1) / (sliders + 1));
            double f = P[IWK] / sliders;
            double x = within(S[S_IWAN + i] + dq * f / d, f);
            S[S_IWAN + i] = x;
            load += x;
        }
        if (P[BWF] != 0) {
            double y = S[S_BOUC_WEN];
            y += (dq - fabs(dq) * (dq * y > 0 ? 1 : 0) * pow(fabs(y), P[BWN]) * (y > 0 ? 1 : -1)) / P[BWD];
            y = within(y, 1);
            S[S_BOUC_WEN] = y;
            load += P[BWF] * y;
        }
        if (P[RGA] > 0) { /* absorber coupled through a spring */
            double w = P[RGW], mass = P[RGA] * P[M_];
            double f = mass * (w * w * (q - S[S_RING_Q]) + 2 * P[RGZ] * w * (v - S[S_RING_V]));
            S[S_RING_V] += f / mass * dt;
            S[S_RING_Q] += S[S_RING_V] * dt;
            load += f;
        }

        /* friction level */
        double F = over_v(friction_v, v) + over_q(friction_q, q);
        F = F * (P[THA] != 0 ? 1 + P[THA] * heat : 1) * friction_factor[k];
        if (P[MU] != 0) {
            double l = fabs(spring + P[MUINER] * (I - spring) * .5);
            double mu = P[MU];
            if (spring * v < 0) mu *= P[MUBACK];
            F += mu * l;
        }
        if (P[DWA] != 0) {
            if (fabs(v) < .3) age += (1 - age) * dt / P[DWT];
            else age -= age * fabs(v) * dt / P[DWD];
            F *= 1 + P[DWA] * age;
        }
        gap = within(gap + dq, P[BLG] / 2);
        if (P[BLG] > 0 && fabs(gap) < P[BLG] / 2 - 1e-9) F *= 1 - P[BLS];
        if (F < .5) F = .5;

        /* step */
        double v_new = v + dt / P[M_] * (I - load);
        double friction;
        if (P[ZS] > 0) { /* bristle */
            double stiffness = F / P[ZS];
            if (k == 0) z = (I - load) / stiffness;
            z = within(z, P[ZS]);
            double bent = z * stiffness / F;
            double give = 1 - (v * bent > 0 ? pow(fabs(bent), P[ZEXP]) : 0);
            z = within(z + v * dt * give, P[ZS]);
            friction = stiffness * z + .35 * sqrt(stiffness * P[M_]) * v * (1 - fabs(z) / P[ZS]);
            v_new -= dt / P[M_] * friction;
        } else { /* set-valued Coulomb friction: sticks exactly */
            double most = dt * F / P[M_];
            double free = v_new;
            if (fabs(v_new) <= most) v_new = 0;
            else v_new -= v_new > 0 ? most : -most;
            friction = (free - v_new) * P[M_] / dt;
        }
        double a = (v_new - v) / dt;
        v = v_new;
        q += v * dt;
        travel += fabs(v) * dt;
        if (P[THA] != 0) {
            double power;
            if (P[THMODE] < .5) power = I * I / (P[THREF] * P[THREF]);
            else power = fabs(friction * v) / (P[THREF] * 30);
            heat += (power - heat) * dt / P[THTAU];
        }
        if (k % 2 == 0) {
            double *row = out + 7 * (k / 2);
            row[0] = q;
            row[1] = v;
            row[2] = a;
            row[3] = I;
            row[4] = friction;
            row[5] = heat;
            row[6] = target;
        }
    }
    S[S_Q] = q;
    S[S_V] = v;
    S[S_INTEGRAL] = integral;
    S[S_HEAT] = heat;
    S[S_AGE] = age;
    S[S_TRAVEL] = travel;
    S[S_BRISTLE] = z;
    S[S_GAP] = gap;
    S[S_CURRENT] = I;
    S[S_BUS] = bus;
    S[S_REFERENCE] = target;
    S[S_FORWARD] = forward;
}

/* Lost motion of full width `gap`, in the units of x. */
void play(int n, double gap, const double *x, double *y) {
    double s = x[0];
    for (int i = 0; i < n; i++) {
        double d = x[i] - s;
        if (d > gap / 2) s = x[i] - gap / 2;
        if (d < -gap / 2) s = x[i] + gap / 2;
        y[i] = s;
    }
}

/* First-order lag of a series at step h s, with a time constant (s) of its own each way. */
void lag(int n, double h, double up, double down, const double *x, double *y) {
    double s = x[0];
    for (int i = 0; i < n; i++) {
        double tau = x[i] > s ? up : down;
        s += tau < h ? x[i] - s : (x[i] - s) * h / tau;
        y[i] = s;
    }
}
