/* Straight DOPRI5(4) loops for  y'' = -y + sin(omega t) - F,  the slip phase of the dry-friction oscillator:
   the field inlined, six evaluations per step (the last stage is the first of the next step), error norm,
   no events, no dense output, nothing stored. They are the yardstick for a step of the integrator. */

#include <math.h>

typedef struct { double force, omega, t, y, v, ky, kv; } Motion;

static inline double acceleration(const Motion *m, double t, double y)
{
    return -y + sin(m->omega * t) - m->force;
}

static inline double square(double x) { return x * x; }

/* Tries one step of length h; returns the mean square of the scaled error and the new point in `next`. */
static inline double try_step(const Motion *m, double h, double rtol, double atol, Motion *next)
{
    const double t = m->t, y = m->y, v = m->v, p1 = m->ky, q1 = m->kv;
    const double p2 = v + h * (1.0 / 5) * q1;
    const double q2 = acceleration(m, t + h / 5, y + h * (1.0 / 5) * p1);
    const double p3 = v + h * (3.0 / 40 * q1 + 9.0 / 40 * q2);
    const double q3 = acceleration(m, t + h * 3 / 10, y + h * (3.0 / 40 * p1 + 9.0 / 40 * p2));
    const double p4 = v + h * (44.0 / 45 * q1 - 56.0 / 15 * q2 + 32.0 / 9 * q3);
    const double q4 = acceleration(m, t + h * 4 / 5, y + h * (44.0 / 45 * p1 - 56.0 / 15 * p2 + 32.0 / 9 * p3));
    const double p5 = v + h * (19372.0 / 6561 * q1 - 25360.0 / 2187 * q2 + 64448.0 / 6561 * q3 - 212.0 / 729 * q4);
    const double q5 = acceleration(
        m, t + h * 8 / 9,
        y + h * (19372.0 / 6561 * p1 - 25360.0 / 2187 * p2 + 64448.0 / 6561 * p3 - 212.0 / 729 * p4));
    const double p6 = v + h * (9017.0 / 3168 * q1 - 355.0 / 33 * q2 + 46732.0 / 5247 * q3 + 49.0 / 176 * q4
                               - 5103.0 / 18656 * q5);
    const double q6 = acceleration(m, t + h,
                                   y + h * (9017.0 / 3168 * p1 - 355.0 / 33 * p2 + 46732.0 / 5247 * p3
                                            + 49.0 / 176 * p4 - 5103.0 / 18656 * p5));
    *next = *m;
    next->t = t + h;
    next->y = y + h * (35.0 / 384 * p1 + 500.0 / 1113 * p3 + 125.0 / 192 * p4 - 2187.0 / 6784 * p5 + 11.0 / 84 * p6);
    next->v = v + h * (35.0 / 384 * q1 + 500.0 / 1113 * q3 + 125.0 / 192 * q4 - 2187.0 / 6784 * q5 + 11.0 / 84 * q6);
    next->ky = next->v;
    next->kv = acceleration(m, next->t, next->y);
    const double error_y = h * (71.0 / 57600 * p1 - 71.0 / 16695 * p3 + 71.0 / 1920 * p4 - 17253.0 / 339200 * p5
                                + 22.0 / 525 * p6 - 1.0 / 40 * next->ky);
    const double error_v = h * (71.0 / 57600 * q1 - 71.0 / 16695 * q3 + 71.0 / 1920 * q4 - 17253.0 / 339200 * q5
                                + 22.0 / 525 * q6 - 1.0 / 40 * next->kv);
    return 0.5 * (square(error_y / (atol + rtol * fmax(fabs(y), fabs(next->y))))
                  + square(error_v / (atol + rtol * fmax(fabs(v), fabs(next->v)))));
}

static Motion start(const double *y0, double force, double omega)
{
    Motion m = {force, omega, 0.0, y0[0], y0[1], y0[1], 0.0};
    m.kv = acceleration(&m, 0.0, m.y);
    return m;
}

/* Makes `n_steps` steps of length h; returns the number of evaluations of the field. */
long fixed_steps(const double *y0, double force, double omega, double h, long n_steps, double tolerance, double *end)
{
    Motion m = start(y0, force, omega), next;
    double largest = 0.0;
    for (long i = 0; i < n_steps; i++) {
        largest = fmax(largest, try_step(&m, h, tolerance, tolerance, &next));
        m = next;
    }
    end[0] = m.y;
    end[1] = m.v;
    end[2] = largest;
    return 1 + 6 * n_steps;
}

/* Integrates to t_end with PI step control; returns the number of steps tried. */
long controlled_steps(const double *y0, double force, double omega, double t_end, double tolerance, double *end)
{
    Motion m = start(y0, force, omega), next;
    double h = 1e-3, previous = 1e-4;
    long n_tried = 0;
    while (m.t < t_end) {
        if (m.t + h > t_end) h = t_end - m.t;
        const double error = sqrt(try_step(&m, h, tolerance, tolerance, &next));
        n_tried++;
        const double shrink = pow(error, 0.17) / 0.9;
        if (error <= 1.0) {
            h /= fmin(5.0, fmax(0.1, shrink / pow(previous, 0.04)));
            previous = fmax(error, 1e-4);
            m = next;
        } else {
            h /= fmin(5.0, shrink);
        }
    }
    end[0] = m.y;
    end[1] = m.v;
    return n_tried;
}
