/* Time stepping of one motor. Position x in % of range, speed v in %/s, loads in raw current units.
 * stepper.py writes the indices P_... of parameters and O_... of output columns in front of this text. */
#include <math.h>

static double bump(double d, int form) {             /* shape 0..1 over the scaled distance d from its middle */
    double a = fabs(d);
    if (form == 1) return a < 2.0 ? 0.5 * (1.0 + cos(M_PI * a / 2.0)) : 0.0;             /* raised cosine */
    if (form == 2) return 0.5 * (tanh((d + 1.2) / 0.3) - tanh((d - 1.2) / 0.3));         /* smooth box */
    if (form == 3) return a < 2.0 ? 1.0 - a / 2.0 : 0.0;                                 /* triangle */
    if (form == 4) return d * exp(0.5 - 0.5 * d * d);               /* dipole: pulls in, then holds */
    return exp(-0.5 * d * d);
}

static double stribeck(double r, int form) {
    if (form == 0) return exp(-r);
    if (form == 1) return exp(-r * r);
    return 1.0 / (1.0 + r);
}

static double spring(double s, int form) {           /* s: share of the range */
    if (form == 0) return s * s * s;
    if (form == 1) return s * fabs(s);
    if (form == 2) return (exp(3.0 * s) - 1.0) / (exp(3.0) - 1.0);
    return -(1.0 - exp(-4.0 * s));                   /* softening */
}

static double stop_load(double d, double depth, int form) {
    if (d <= 0.0) return 0.0;
    d /= depth;
    if (form == 0) return d;
    if (form == 1) return d * d;
    return (exp(2.0 * d) - 1.0) / (exp(2.0) - 1.0);
}

static double clip(double v, double lo, double hi) { return v < lo ? lo : (v > hi ? hi : v); }

static double bristle(double z, double v, double dt, double s0, double g) {
    return (z + v * dt) / (1.0 + s0 * fabs(v) * dt / g);
}

/* state: x v z z_shadow z_soft hysteresis y1 y2 temperature integral v_command u_slow */
void run(long n, double dt, const double *p, const double *setpoint, const double *xref, const double *vref,
         const double *vlim, const double *load_t, const double *friction_t, const double *spring_t,
         const double *contact_t, const double *heat_t, double *st, double *out) {
    double x = st[0], v = st[1], z = st[2], zs = st[3], zp = st[4], h = st[5], y1 = st[6], y2 = st[7];
    double temp = st[8], integ = st[9], vc = st[10], us = st[11];
    double late = 0.0, range = 100.0;
    for (long i = 0; i < n; i++) {
        /* drive */
        if (i > 0 && setpoint[i] != setpoint[i - 1]) late = 0.0;
        double r = 1.0;
        if (p[P_sag_speed] > 0.0) r = clip(1.0 - p[P_sag_speed] * us / 60.0, 0.6, 1.0);
        late += (1.0 - r) * dt;
        long j = i - (long)(late / dt);
        if (j < 0) j = 0;
        double u;
        if (p[P_mode] < 0.5) {
            double e = xref[j] - x;
            integ = clip(integ + p[P_gain_i] * e * dt, -12.0, 12.0);
            u = p[P_gain_p] * e + p[P_gain_d] * (vref[j] * r - v) + integ;
        } else {
            double e = setpoint[i] - x, want = p[P_gain_p] * (e - clip(e, -p[P_dead], p[P_dead]));
            want = clip(want, -vlim[i] * r, vlim[i] * r);
            vc += clip(want - vc, -p[P_accel] * dt, p[P_accel] * dt);
            integ = clip(integ + p[P_gain_i] * (vc - v) * dt, -400.0, 400.0);
            if (want == 0.0 && fabs(v) < 0.5) integ *= 1.0 - dt / 0.15;
            u = p[P_gain_d] * (vc - v) + integ;
        }
        us += (fabs(u) - us) * dt / 0.08;
        if (p[P_sag_gain] > 0.0) u *= 1.0 - clip(p[P_sag_gain] * us / 60.0, 0.0, 0.6);
        if (p[P_sag_leak] > 0.0 && fabs(u) > p[P_sag_from]) u -= copysign(p[P_sag_leak] * (fabs(u) - p[P_sag_from]), u);
        if (p[P_ceiling_share] > 0.0) u += p[P_ceiling_share] * (clip(u, -p[P_ceiling], p[P_ceiling]) - u);

        /* friction level */
        double dir = v >= 0.0 ? 1.0 : -1.0, fc = p[P_Fc], g = fc, s = x / range;
        double kx = (p[P_k] + spring_t[i]) * x + p[P_tau0];
        if (p[P_st_amp] != 0.0) g += fc * p[P_st_amp] * stribeck(fabs(v) / p[P_st_speed], (int)p[P_st_form]);
        if (p[P_asym_friction] != 0.0)
            g += fc * p[P_asym_friction] * (p[P_asym_form] < 0.5 ? dir : (dir > 0.0 ? 2.0 : 0.0));
        if (p[P_load_mu] != 0.0) {
            double l = kx;
            if (p[P_load_form] > 0.5) l += out[(i ? i - 1 : 0) * O_COUNT + O_a] * p[P_m];
            if (p[P_load_form] > 1.5) l = i ? out[(i - 1) * O_COUNT + O_u] : 0.0;
            g += p[P_load_mu] * fabs(l);
        }
        if (p[P_spot_amp] != 0.0)
            g += fc * p[P_spot_amp] * bump((x - p[P_spot_at]) / p[P_spot_width], (int)p[P_spot_form]);
        if (p[P_heat_power] != 0.0) {
            double power = fabs(out[(i ? i - 1 : 0) * O_COUNT + O_friction] * v) / 3000.0;
            temp += dt * (power / p[P_heat_power_rise] - temp / p[P_heat_power_fall]);
            g += fc * p[P_heat_power] * temp;
        }
        g += fc * heat_t[i] + friction_t[i];
        if (g < 0.05 * fc) g = 0.05 * fc;
        double s0 = p[P_bristle];
        z = bristle(z, v, dt, s0, g);
        zs = bristle(zs, v, dt, s0, fc);
        double f = s0 * z, fs = s0 * zs;
        if (p[P_soft_share] != 0.0) {
            double sp = fc / p[P_soft_distance];
            if (p[P_soft_form] < 0.5) zp = bristle(zp, v, dt, sp, fc);
            else if (p[P_soft_form] < 1.5) {             /* Dahl with exponent 1/2 towards the limit */
                double q = 1.0 - sp * zp * dir / fc;
                zp += v * dt * sqrt(q > 0.0 ? q : 0.0);
            } else zp = clip(zp + v * dt, -fc / sp, fc / sp);
            f += p[P_soft_share] * (sp * zp - fs);
        }

        /* loads */
        double extra = load_t[i];
        if (p[P_visc_amp] != 0.0) {
            double one = p[P_visc_form] < 1.5 ? dir : -dir, w = p[P_visc_form] < 0.5 ? dir : (one > 0.0 ? 2.0 : 0.0);
            extra += p[P_b] * p[P_visc_amp] * v * w;
        }
        if (p[P_detent_amp] != 0.0)
            extra += p[P_detent_amp] * bump((x - p[P_detent_at]) / p[P_detent_width], (int)p[P_detent_form]);
        if (p[P_spring_amp] != 0.0) extra += p[P_spring_amp] * spring(s, (int)p[P_spring_form]);
        if (p[P_gravity] != 0.0) {
            double q = p[P_angle_full] * s + p[P_gravity_lean];
            extra += p[P_gravity] * (p[P_gravity_c] * cos(q) + p[P_gravity_s] * sin(q));
        }
        if (p[P_ripple_amp] != 0.0) {
            double q = 2.0 * M_PI * x / p[P_ripple_period] + p[P_ripple_phase];
            double w = sin(q) + p[P_ripple_second] * sin(2.0 * q + 1.0);
            if (p[P_ripple_by_load] > 0.5) w *= us / 50.0;
            extra += p[P_ripple_amp] * w;
        }
        if (p[P_drag_amp] != 0.0) extra += p[P_drag_amp] * dir * pow(fabs(v) / 100.0, p[P_drag_power]);
        if (p[P_hyst_amp] != 0.0) {
            double d = v * dt / p[P_hyst_distance];
            if (p[P_hyst_form] < 0.5) h = clip(h + d, -1.0, 1.0);
            else if (p[P_hyst_form] < 1.5) h = (h + d) / (1.0 + fabs(d));
            else h = clip(h + d * (h * d > 0.0 ? 1.0 - h * h : 1.0), -1.0, 1.0);
            extra += p[P_hyst_amp] * h;
        }
        if (p[P_relax_amp] != 0.0) {
            y1 += (x - y1) * dt / p[P_relax_time];
            y2 += (x - y2) * dt / p[P_relax_time2];
            extra += p[P_relax_amp] * ((1.0 - p[P_relax_second]) * (x - y1) + p[P_relax_second] * (x - y2)) / range;
        }
        if (p[P_stop_amp] != 0.0) {
            double d = p[P_stop_low] > 0.5 ? p[P_stop_at] - x : x - p[P_stop_at];
            double w = p[P_stop_amp] * stop_load(d, p[P_stop_depth], (int)p[P_stop_form]);
            extra += p[P_stop_low] > 0.5 ? -w : w;
        }
        double touch = 0.0;
        if (p[P_touch_amp] != 0.0)
            touch = contact_t[i] * p[P_touch_amp] * stop_load(x - p[P_touch_at], p[P_touch_depth], 0);
        extra += touch;

        double a = (u - f - p[P_b] * v - kx - extra) / p[P_m];
        double *o = out + i * O_COUNT;
        o[O_x] = x; o[O_v] = v; o[O_a] = a; o[O_u] = u;
        o[O_friction] = f; o[O_extra] = extra + f - fs + spring_t[i] * x;
        o[O_shadow] = fs; o[O_contact] = touch; o[O_heat] = temp;
        v += a * dt;
        x += v * dt;
    }
    st[0] = x; st[1] = v; st[2] = z; st[3] = zs; st[4] = zp; st[5] = h; st[6] = y1; st[7] = y2;
    st[8] = temp; st[9] = integ; st[10] = vc; st[11] = us;
}

/* Lost motion of full width w: y follows x at the edges of the play. */
void play(long n, double w, const double *x, double *y) {
    double last = x[0];
    for (long i = 0; i < n; i++) { last = clip(last, x[i] - w / 2.0, x[i] + w / 2.0); y[i] = last; }
}

/* Hysteresis -1..1 that builds up exponentially over the distance d of x after a reversal. */
void memory(long n, double d, const double *x, double *y) {
    double h = 0.0, dx;
    y[0] = 0.0;
    for (long i = 1; i < n; i++) { dx = (x[i] - x[i - 1]) / d; h = (h + dx) / (1.0 + fabs(dx)); y[i] = h; }
}

/* First-order lag with time constant tau, s. */
void lag(long n, double dt, double tau, const double *x, double *y) {
    double last = x[0], c = dt / (tau + dt);
    for (long i = 0; i < n; i++) { last += (x[i] - last) * c; y[i] = last; }
}
