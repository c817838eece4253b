/* The gear with backlash by hand: Taylor series in each region, crossings as their roots.
 *
 *     x' = v,  v' = w - v - (x^2 + A) f(x),  w = B + C sin(omega t)
 *
 * with f the dead zone of half-width D. What a careful programmer would write for this one
 * model, so that a general tool can be compared with it. Steps as in Jorba & Zou (2005).
 */
#include <math.h>
#include <pthread.h>

#define ORDER 16
#define LENGTH (ORDER + 1)

typedef struct {
    double A, B, C, D, omega, tol;
} gear;

typedef struct {
    double x[LENGTH], v[LENGTH];
} series;

static void expand(const gear *g, int region, double t, double x0, double v0, series *s) {
    double q[LENGTH], y[LENGTH], w[LENGTH], c[LENGTH];
    const double offset = region * g->D;
    double phase = g->omega * t;
    s->x[0] = x0;
    s->v[0] = v0;
    w[0] = sin(phase);
    c[0] = cos(phase);
    for (int k = 0; k < ORDER; k++) {
        double product = 0.0, square = 0.0;
        if (region) {
            for (int i = 0; i <= k; i++) square += s->x[i] * s->x[k - i];
            q[k] = square + (k ? 0.0 : g->A);
            y[k] = s->x[k] - (k ? 0.0 : offset);
            for (int i = 0; i <= k; i++) product += q[i] * y[k - i];
        }
        const double load = g->C * w[k] + (k ? 0.0 : g->B);
        const double next = 1.0 / (k + 1);
        s->x[k + 1] = s->v[k] * next;
        s->v[k + 1] = (load - s->v[k] - product) * next;
        w[k + 1] = g->omega * c[k] * next;
        c[k + 1] = -g->omega * w[k] * next;
    }
}

static double at(const double *a, double h) {
    double value = a[ORDER];
    for (int k = ORDER - 1; k >= 0; k--) value = value * h + a[k];
    return value;
}

static double slope(const double *a, double h) {
    double value = ORDER * a[ORDER];
    for (int k = ORDER - 1; k > 0; k--) value = value * h + k * a[k];
    return value;
}

static double length_of(const series *s, double tol) {
    const double size = fmax(fmax(fabs(s->x[0]), fabs(s->v[0])), 1e-3);
    const double last = fmax(fabs(s->x[ORDER]), fabs(s->v[ORDER]));
    const double before = fmax(fabs(s->x[ORDER - 1]), fabs(s->v[ORDER - 1]));
    const double one = pow(tol * size / fmax(last, 1e-300), 1.0 / ORDER);
    const double two = pow(tol * size / fmax(before, 1e-300), 1.0 / (ORDER - 1));
    return fmin(one, two);
}

/* First root of a(h) - level in (0, h], or -1. `left`: the value at 0 is a root just left. */
static double first_root(const double *a, double level, double h, int left) {
    /* no root where the terms cannot reach the level, one at most where the first one rules */
    double reach = 0.0, bend = 0.0, power = h;
    for (int k = 1; k < LENGTH; k++) {
        const double size = fabs(a[k]) * power;
        reach += size;
        bend += k * size;
        power *= h;
    }
    if (fabs(a[0] - level) > reach) return -1.0;
    const int parts = 2.0 * fabs(a[1]) * h > bend ? 1 : 16;
    double from = 0.0, value = left ? a[1] : a[0] - level;
    for (int k = 1; k <= parts; k++) {
        const double to = h * k / parts, next = at(a, to) - level;
        if ((value > 0.0) != (next > 0.0)) {
            double low = from, high = to, s = 0.5 * (low + high);
            for (int n = 0; n < 60; n++) {
                const double f = at(a, s) - level;
                if ((f > 0.0) == (value > 0.0)) low = s; else high = s;
                double better = s - f / slope(a, s);
                if (!(better > low && better < high)) better = 0.5 * (low + high);
                if (fabs(better - s) <= 4e-16 * h) return better;
                s = better;
            }
            return s;
        }
        from = to;
        value = next;
    }
    return -1.0;
}

/* From rest to `end`: x at increasing times, extremes of x, crossings. Returns the crossings. */
static long follow(const gear *g, double end, const double *times, long count, double *out,
                   double *extremes) {
    double t = 0.0, x = 0.0, v = 0.0;
    int region = 0, left = 0;
    long done = 0, hits = 0;
    series s;
    extremes[0] = extremes[1] = 0.0;
    while (t < end) {
        expand(g, region, t, x, v, &s);
        double h = fmin(length_of(&s, g->tol), end - t);
        int next = region, side = 0;
        for (int edge = -1; edge <= 1; edge += 2) {
            if (region && edge != region) continue;
            const double root = first_root(s.x, edge * g->D, h, left == edge);
            if (root > 0.0) {
                h = root;
                side = edge;
                next = region ? 0 : edge;
            }
        }
        while (done < count && times[done] <= t + h) {
            out[done] = at(s.x, times[done] - t);
            done++;
        }
        const double turn = first_root(s.v, 0.0, h, 0);
        x = at(s.x, h);
        v = at(s.v, h);
        const double peak = turn > 0.0 ? at(s.x, turn) : x;
        extremes[0] = fmin(extremes[0], fmin(x, peak));
        extremes[1] = fmax(extremes[1], fmax(x, peak));
        t = h == end - t ? end : t + h;
        left = side;
        if (side) {
            x = side * g->D;
            region = next;
            hits++;
        }
    }
    return hits;
}

long run(double A, double B, double C, double D, double omega, double tol, double end,
         const double *times, long count, double *out) {
    const gear g = {A, B, C, D, omega, tol};
    double extremes[2];
    return follow(&g, end, times, count, out, extremes);
}

typedef struct {
    const double *C, *D;
    double A, B, omega, tol, end;
    long first, last;
    double *extremes;
    long *hits;
} share;

static void *part(void *argument) {
    const share *s = argument;
    for (long k = s->first; k < s->last; k++) {
        const gear g = {s->A, s->B, s->C[k], s->D[k], s->omega, s->tol};
        s->hits[k] = follow(&g, s->end, 0, 0, 0, s->extremes + 2 * k);
    }
    return 0;
}

/* Many gears on some threads: extremes and crossings of each. */
void many(double A, double B, const double *C, const double *D, double omega, double tol,
          double end, long count, long threads, double *extremes, long *hits) {
    pthread_t started[64];
    share shares[64];
    for (long k = 0; k < threads; k++) {
        shares[k] = (share){C,   D,
                            A,   B,
                            omega, tol,
                            end, k * count / threads,
                            (k + 1) * count / threads, extremes,
                            hits};
        pthread_create(&started[k], 0, part, &shares[k]);
    }
    for (long k = 0; k < threads; k++) pthread_join(started[k], 0);
}
