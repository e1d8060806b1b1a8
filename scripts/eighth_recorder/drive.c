/* One trial of one motor: ramped setpoint, position loop, stick-slip; written every `skip` steps. */
#include "params.h"
#include "loads.h"

void run(const P *p, State *s, int n, int skip, double dt, double start, const double *target, const double *pace,
         const double *gate, const double *away, const double *gc, const double *gs, const double *ext, const double *dirt,
         double *xs, double *vs, double *is, double *refs)
{
    double x = start, v = 0, ref = target[0], soft = ref;
    if (s->mass_x == 0) s->mass_x = x;
    s->relax_a = s->relax_b = x;
    for (int j = 0; j < n; j++) {
        double i = 0;
        if (p->restart > 0 && j > 0 && target[j] != target[j - 1]) ref = x;     /* a new move starts from where the finger is */
        for (int q = 0; q < skip; q++) {
            double gap = target[j] - ref, most = pace[j] * dt;
            double step = gap > most ? most : gap < -most ? -most : gap;
            ref += step;
            soft += dt / p->soft * (ref - soft);
            double seen = x + p->enc_amp * sin(2 * M_PI * x / p->enc_period + p->enc_phase);
            i = p->kp * (soft - seen) - p->kd * v;
            i = i > p->limit ? p->limit : i < -p->limit ? -p->limit : i;
            double given = i * (1 - p->sag * s->sag - p->emf * fabs(v) / 110);
            if (q == 0) { xs[j] = x; vs[j] = v; is[j] = i; refs[j] = soft; }
            double force = given - load(p, s, x, v, gate[j], away[j], gc[j], gs[j], ext[j]) - drag(p, v);
            double way = v != 0 ? sign(v) : sign(force);
            double most_dry = dry(p, s, x, v, way, dirt[j]);
            if (p->bristle_x > 0) {
                double w = sign(v);
                if (w != 0) s->bristle = w + (s->bristle - w) * exp(-fabs(v) * dt / p->bristle_x);
                double micro = 1.2 * sqrt(p->m * most_dry / p->bristle_x) * exp(-v * v / 25.0);
                v = (v + dt / p->m * (force - most_dry * s->bristle)) / (1 + dt / p->m * micro);
            } else {
                double free_v = v + dt / p->m * force, stop = dt / p->m * most_dry;
                v = fabs(free_v) <= stop ? 0 : free_v - sign(free_v) * stop;
            }
            x += v * dt;
            remember(p, s, x, v, i, dt);
        }
    }
}

/* Lost motion: the output follows only when an edge of the gap pushes it. */
void play(const double *in, double *out, int n, double gap)
{
    double y = in[0] - gap / 2;
    for (int j = 0; j < n; j++) {
        if (in[j] - gap / 2 > y) y = in[j] - gap / 2;
        if (in[j] + gap / 2 < y) y = in[j] + gap / 2;
        out[j] = y;
    }
}
