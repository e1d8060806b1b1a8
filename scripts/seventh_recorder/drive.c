/* One finger drive: position controller, motor with bristle friction, spring, and what may be hidden in it.
   Positions in % of the range, currents in raw units, time in s. P_* are indices made by stepper.py. */
#include <math.h>

static double table(const double *y, double q) {
    double x = (q - TABLE_START) / TABLE_STEP;
    if (x < 0) x = 0;
    if (x > TABLE_SIZE - 1.001) x = TABLE_SIZE - 1.001;
    int i = (int)x;
    return y[i] + (x - i) * (y[i + 1] - y[i]);
}

static double clip(double x, double lo, double hi) { return x < lo ? lo : x > hi ? hi : x; }

void run(int n, double dt, int every, const double *p, const double *ref, const double *ref_v,
         const double *extra_load, const double *load_table, const double *friction_table, double *out) {
    double q = 0, v = 0, a = 0, z = 0, z2 = 0, w1 = 0, w2 = 0, sag = 0, u = 0, dwell = 0;
    double jenkins[3] = {0, 0, 0};
    for (int i = 0; i < n; i++) {
        double t = i * dt;
        double current = clip(p[P_kp] * (ref[i] - q) + p[P_kd] * (ref_v[i] - v), -p[P_limit], p[P_limit]);
        sag += p[P_sag_tau] > 0 ? dt / p[P_sag_tau] * (fabs(current) - sag) : fabs(current) - sag;
        double drive = current / (1 + p[P_sag] * sag / 100);
        double way = tanh(v / 0.5);

        double spring = p[P_k] * q + p[P_tau0];
        u = p[P_follow_tau] > 0 ? fmax(q, u + dt / p[P_follow_tau] * (q - u)) : q;
        u = fmax(u, p[P_rest_at]);
        if (u > q + 0.05) spring *= 1 - p[P_unload];
        double load = spring + table(load_table, q) + extra_load[i];
        w1 += dt / p[P_arm1_tau] * (q - w1);
        w2 += dt / p[P_arm2_tau] * (q - w2);
        load += p[P_arm1] * (q - w1) + p[P_arm2] * (q - w2);
        if (q > p[P_stop_at]) load += p[P_stop_k] * (q - p[P_stop_at]) * (1 + p[P_stop_c] * v);
        if (t > p[P_touch_from] && t < p[P_touch_to] && q > p[P_touch_at])
            load += p[P_touch_k] * (q - p[P_touch_at]) + p[P_touch_c] * fmax(v, 0);

        double level = p[P_Fc] + p[P_stribeck] * exp(-pow(fabs(v) / p[P_vs], p[P_stribeck_power]));
        level *= 1 + p[P_Fc_asymmetry] * way;
        level += table(friction_table, q) + p[P_mu_load] * fabs(spring) + p[P_mu_drive] * fabs(drive);
        level += p[P_accel_friction] * fabs(a);
        double warm = (t + p[P_on_time]) / p[P_warm_tau];
        level *= 1 - p[P_warm] * (1 - exp(-warm));
        dwell = fabs(v) < 1 ? dwell + dt : dwell * exp(-fabs(v) * dt / 1.5);
        level += p[P_ageing] * log1p(dwell / 0.05);
        double zd = v - p[P_sigma0] * fabs(v) / level * z;
        double friction = p[P_sigma0] * z + p[P_sigma1] * zd;

        double z2d = v * (1 - (v > 0 ? 1 : -1) * z2 / p[P_hysteresis_way]);
        friction += p[P_hysteresis] * z2 / p[P_hysteresis_way];
        for (int j = 0; j < 3; j++) {
            double limit = p[P_jenkins_1 + j], way_j = p[P_jenkins_way] * (j + 1) / 2;
            jenkins[j] = clip(jenkins[j] + v * dt * (limit / way_j), -limit, limit);
            friction += jenkins[j];
        }
        double drag = p[P_b] * (1 + p[P_b_asymmetry] * way) * v + p[P_b_back] * fmin(v, 0)
                    + p[P_quadratic] * v * fabs(v) + p[P_cubic] * v * v * v;

        if (i % every == 0) {
            double *o = out + 5 * (i / every);
            o[0] = q; o[1] = v; o[2] = current; o[3] = friction; o[4] = u;
        }
        a = (drive - friction - drag - load) / p[P_m];
        v += a * dt;
        q += v * dt;
        z += zd * dt;
        z2 += z2d * dt;
    }
}
