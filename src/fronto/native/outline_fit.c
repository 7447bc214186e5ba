/* Quads through the edge points of masks, one mask after the other, and sides through stations.
 *
 * Points of mask i are xy[first[i]] .. xy[first[i + 1] - 1], in pixels. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "fronto_kernels.h"
#include "robust.h"

/* Points further from a side than this share of the mask's size belong to no side. */
static const double FAR = 0.2;
/* Eighths of a side's central part, to see along how much of it there are points. */
enum { BINS = 8 };
/* Once corners move by less, pixels, points stay with their sides. */
static const double SETTLED = 0.5;
/* Sides that move by less, pixels, stand still. */
static const double STILL_OFF = 1e-4;

/* A parallelogram: points are whitened, which makes it a square, and where its corners are
 * is told by the fourth harmonic of its outline. */
static int start_quad(int64_t n, const double *p, double *corner) {
    double mx = 0, my = 0, xx = 0, xy = 0, yy = 0;
    for (int64_t i = 0; i < n; i++) mx += p[2 * i], my += p[2 * i + 1];
    mx /= n, my /= n;
    for (int64_t i = 0; i < n; i++) {
        const double dx = p[2 * i] - mx, dy = p[2 * i + 1] - my;
        xx += dx * dx, xy += dx * dy, yy += dy * dy;
    }
    xx /= n, xy /= n, yy /= n;
    /* Cholesky: any root of the scatter whitens. */
    const double a = sqrt(xx), b = xy / a, c2 = yy - b * b;
    if (!(a > 1e-6) || !(c2 > 1e-9 * yy) || !(yy > 1e-9 * xx)) return 0;
    const double c = sqrt(c2);
    double re = 0, im = 0;
    for (int64_t i = 0; i < n; i++) {
        const double u = (p[2 * i] - mx) / a, v = (p[2 * i + 1] - my - b * u) / c;
        /* |z|^4 e^(4 i angle) = z^4: far points, the corners, count most. */
        const double r2 = u * u - v * v, i2 = 2 * u * v;
        re += r2 * r2 - i2 * i2, im += 2 * r2 * i2;
    }
    const double angle = atan2(im, re) / 4;
    for (int k = 0; k < 4; k++) {
        /* The outline of a square of variance 1 has its corners at sqrt(3). */
        const double u = sqrt(3.0) * cos(angle + k * 1.5707963267948966);
        const double v = sqrt(3.0) * sin(angle + k * 1.5707963267948966);
        corner[2 * k] = mx + a * u;
        corner[2 * k + 1] = my + b * u + c * v;
    }
    return 1;
}

typedef struct {
    double tx, ty, mx, my, inverse; /* tangent, middle, 1 / length */
    double w, x, y, xx, xy, yy;    /* weighted sums */
    unsigned bins;
    double seen;
} Side;

/* New lines, and corners from them if those are a sound quad. */
/* Returns how far the corners have moved. */
static double move_sides(Side *side, double *corner, double *line, double *rms, double size) {
    double moved[8], farthest = 0;
    for (int k = 0; k < 4; k++) {
        Side *s = side + k;
        double *l = line + 3 * k;
        l[0] = s->ty, l[1] = -s->tx, l[2] = s->ty * s->mx - s->tx * s->my;
        rms[k] = NAN;
        if (s->seen < 3 || !(s->w > 0)) continue;
        const double x = s->x / s->w, y = s->y / s->w;
        const double xx = s->xx / s->w - x * x, xy = s->xy / s->w - x * y, yy = s->yy / s->w - y * y;
        const double reach = hypot((xx - yy) / 2, xy), most = (xx + yy) / 2 + reach;
        const double least = (xx + yy) / 2 - reach;
        /* One pixel's width of points has no direction. */
        if (!(most > 0.09) || !(most > 4 * least)) continue;
        const double angle = atan2(2 * xy, xx - yy) / 2;
        double nx = -sin(angle), ny = cos(angle);
        if (nx * l[0] + ny * l[1] < 0) nx = -nx, ny = -ny;
        /* sums are relative to the side's middle */
        l[0] = nx, l[1] = ny, l[2] = nx * (x + s->mx) + ny * (y + s->my);
        rms[k] = sqrt(least > 0 ? least : 0.0);
    }
    for (int k = 0; k < 4; k++) {
        const double *p = line + 3 * ((k + 3) % 4), *q = line + 3 * k;
        const double det = p[0] * q[1] - p[1] * q[0];
        moved[2 * k] = (p[2] * q[1] - p[1] * q[2]) / det;
        moved[2 * k + 1] = (p[0] * q[2] - p[2] * q[0]) / det;
        const double far = hypot(moved[2 * k] - corner[2 * k], moved[2 * k + 1] - corner[2 * k + 1]);
        if (!(far < 2 * size)) return INFINITY;
        farthest = fmax(farthest, far);
    }
    for (int k = 0; k < 4; k++) {
        const double *a = moved + 2 * k, *b = moved + 2 * ((k + 1) % 4), *c = moved + 2 * ((k + 2) % 4);
        if (!((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) > 0)) return INFINITY;
    }
    for (int k = 0; k < 8; k++) corner[k] = moved[k];
    return farthest;
}

/* Sides between corners, nothing summed. */
static void start_sides(const double *corner, Side *side) {
    for (int k = 0; k < 4; k++) {
        const double *a = corner + 2 * k, *b = corner + 2 * ((k + 1) % 4);
        Side s = {0};
        s.inverse = 1 / hypot(b[0] - a[0], b[1] - a[1]);
        s.tx = (b[0] - a[0]) * s.inverse, s.ty = (b[1] - a[1]) * s.inverse;
        s.mx = (a[0] + b[0]) / 2, s.my = (a[1] + b[1]) / 2;
        side[k] = s;
    }
}

/* Distances off (n) of points from the sides that they have gone to. */
static void measure_points(int64_t n, const double *p, const Side *side, const int *of,
                           double *off) {
    for (int64_t i = 0; i < n; i++) {
        const Side *s = side + of[i];
        off[i] = fabs((p[2 * i] - s->mx) * s->ty - (p[2 * i + 1] - s->my) * s->tx);
    }
}

/* Each point goes to its nearest side, if it lies along that side's central part: place (n)
 * along the side, or NaN where it goes to none; off (n) its distance; of (n) the side. */
static void sort_points(int64_t n, const double *p, const uint8_t *border, double size,
                        double central, const Side *side, int *of, double *place, double *off) {
    for (int64_t i = 0; i < n; i++) {
        off[i] = FAR * size, place[i] = NAN, of[i] = 0;
        if (border[i]) continue;
        for (int k = 0; k < 4; k++) {
            const Side *s = side + k;
            const double dx = p[2 * i] - s->mx, dy = p[2 * i + 1] - s->my;
            const double d = fabs(dx * s->ty - dy * s->tx);
            if (!(d < off[i])) continue;
            const double t = (dx * s->tx + dy * s->ty) * s->inverse;
            if (fabs(t) <= 0.5) off[i] = d, of[i] = k, place[i] = t;
        }
        if (!(fabs(place[i]) <= central / 2)) place[i] = NAN;
    }
}

/* Weighted sums of each side's points; work (n) is scratch. The first round's sides are
 * guesses: all points count. */
static void sum_sides(int64_t n, const double *p, double central, int first_round, Side *side,
                      const int *of, const double *place, const double *off, double *work) {
    int64_t start[5] = {0}, filled[4];
    double reach[4];
    const double scale = BINS / central;
    for (int64_t i = 0; i < n; i++) start[of[i] + 1] += place[i] == place[i];
    for (int k = 0; k < 4; k++) filled[k] = start[k], start[k + 1] += start[k];
    for (int64_t i = 0; i < n; i++)
        if (place[i] == place[i]) work[filled[of[i]]++] = off[i];
    for (int k = 0; k < 4; k++) {
        const int64_t own = start[k + 1] - start[k];
        const double middle = own ? select_kth(work + start[k], own, own / 2) : 0.0;
        reach[k] = 1 / (TUKEY * fmax(1.4826 * middle, FLOOR_PX));
    }
    for (int64_t i = 0; i < n; i++) {
        if (!(place[i] == place[i])) continue;
        Side *s = side + of[i];
        const double w = first_round ? 1.0 : weight(off[i], reach[of[i]]);
        if (!(w > 0)) continue;
        const double x = p[2 * i] - s->mx, y = p[2 * i + 1] - s->my;
        const int bin = (int)(place[i] * scale + 0.5 * BINS);
        s->bins |= 1u << (bin < 0 ? 0 : bin >= BINS ? BINS - 1 : bin);
        s->seen += 1;
        s->w += w, s->x += w * x, s->y += w * y;
        s->xx += w * x * x, s->xy += w * x * y, s->yy += w * y * y;
    }
}

/* Every so manieth point, and whether it is on the border -> their number. */
static int64_t thin(int64_t n, int64_t every, const double *p, const uint8_t *border, double *to,
                    uint8_t *on_border) {
    int64_t kept = 0;
    for (int64_t i = 0; i < n; i += every, kept++) {
        to[2 * kept] = p[2 * i], to[2 * kept + 1] = p[2 * i + 1];
        on_border[kept] = border[i];
    }
    return kept;
}

/* still: corners that move by less, pixels, are good enough. every (n): of each mask's points every
 * so manieth is looked at.
 * corner (n,4,2): in: where to start, or NaN to find that; out: the quads, clockwise as seen,
 * NaN where there is none. central (n): share of a side on which its line is fitted.
 * line (n,4,3): normal outwards and offset of the sides; side k runs from corner k to the
 * next. covered, rms, count (n,4): share of the central part with points, RMS of their
 * distances (NaN: a side without a line of its own), number. Returns 0 if memory ran out. */
FRONTO_API int fronto_fit_quads(int64_t n, double still, const int64_t *first, const double *xy,
                                const uint8_t *border, const int64_t *every,
                                const double *size, const double *central, double *corner, double *line,
                                double *covered, double *rms, double *count) {
    int64_t most = 1;
    for (int64_t i = 0; i < n; i++)
        if (first[i + 1] - first[i] > most) most = first[i + 1] - first[i];
    double *place = malloc(5 * (size_t)most * sizeof *place);
    int *of = malloc((size_t)most * sizeof *of);
    uint8_t *thinned_border = malloc((size_t)most);
    if (!place || !of || !thinned_border) {
        free(place);
        free(of);
        free(thinned_border);
        return 0;
    }
    double *off = place + most, *work = off + most, *thinned = work + most;
    for (int64_t i = 0; i < n; i++) {
        int64_t points = first[i + 1] - first[i];
        const double *p = xy + 2 * first[i];
        const uint8_t *on_border = border + first[i];
        double *c = corner + 8 * i;
        Side side[4];
        if (every[i] > 1) {
            points = thin(points, every[i], p, on_border, thinned, thinned_border);
            p = thinned, on_border = thinned_border;
        }
        for (int k = 0; k < 4; k++) covered[4 * i + k] = 0, rms[4 * i + k] = NAN, count[4 * i + k] = 0;
        for (int k = 0; k < 12; k++) line[12 * i + k] = NAN;
        if (points < 4 || !(size[i] > 0) || (!(c[0] == c[0]) && !start_quad(points, p, c))) {
            for (int k = 0; k < 8; k++) c[k] = NAN;
            continue;
        }
        double moved = INFINITY;
        for (int round = 0; round < ROUNDS; round++) {
            start_sides(c, side);
            if (moved < SETTLED)
                measure_points(points, p, side, of, off);
            else
                sort_points(points, p, on_border, size[i], central[i], side, of, place, off);
            sum_sides(points, p, central[i], round == 0, side, of, place, off, work);
            moved = move_sides(side, c, line + 12 * i, rms + 4 * i, size[i]);
            if (round > 1 && moved < still) break;
        }
        for (int k = 0; k < 4; k++) {
            int hit = 0;
            for (unsigned b = side[k].bins; b; b >>= 1) hit += (int)(b & 1u);
            covered[4 * i + k] = (double)hit / BINS;
            count[4 * i + k] = side[k].seen;
        }
    }
    free(place);
    free(of);
    free(thinned_border);
    return 1;
}

/* A robust line offset = a + b t through k stations, NaN: none there: line (2), RMS of the
 * deviations (infinity without stations), share of the stations that the line passes. k is at
 * most 64. */
static void fit_offset(int64_t k, const double *v, const double *u, double *line, double *rms,
                       double *seen) {
    double off[64], sorted[64];
    double a = 0, b = 0, reach = 0;
    line[0] = line[1] = *seen = 0, *rms = INFINITY;
    for (int round = 0; round < ROUNDS; round++) {
        double w0 = 0, ut = 0, vt = 0, uu = 0, uv = 0, sum = 0;
        int64_t finite = 0, good = 0;
        const double before = a;
        for (int64_t j = 0; j < k; j++) {
            if (!(v[j] == v[j])) continue;
            const double w = weight(v[j] - a - b * u[j], reach);
            w0 += w, ut += w * u[j], vt += w * v[j];
            uu += w * u[j] * u[j], uv += w * u[j] * v[j];
        }
        if (!(w0 > 2)) break;
        ut /= w0, vt /= w0, uu -= w0 * ut * ut, uv -= w0 * ut * vt;
        if (!(uu > 1e-12)) break;
        b = uv / uu, a = vt - b * ut;
        for (int64_t j = 0; j < k; j++) {
            if (!(v[j] == v[j])) continue;
            off[finite] = fabs(v[j] - a - b * u[j]);
            sorted[finite] = off[finite], finite++;
        }
        reach = 1 / (TUKEY * fmax(1.4826 * select_kth(sorted, finite, finite / 2), 0.05));
        w0 = 0;
        for (int64_t j = 0; j < finite; j++) {
            const double w = weight(off[j], reach);
            w0 += w, sum += w * off[j] * off[j], good += w > 0.3;
        }
        line[0] = a, line[1] = b;
        *rms = w0 > 0 ? sqrt(sum / w0) : INFINITY;
        *seen = (double)good / (double)k;
        if (round > 1 && fabs(a - before) < STILL_OFF) break;
    }
}

/* Where two lines nx x + ny y = c meet. */
static void meet(const double *p, const double *q, double *at) {
    const double det = p[0] * q[1] - p[1] * q[0];
    at[0] = (p[2] * q[1] - p[1] * q[2]) / det;
    at[1] = (p[0] * q[2] - p[2] * q[0]) / det;
}

/* Sides of n quads, lines (n,4,3), moved by what was found at their stations: offset (n,4,k)
 * outwards, NaN for none, at places t (n,k) along the sides, -1/2 to 1/2 from corner to corner.
 * masks (n,4,3): the sides that the masks have. -> moved (n,4,3); spread (n,4): RMS of the
 * stations from the moved side; seen (n,4): share of the stations that it passes; near, turned
 * (n,4): how far it is from the mask's at the middle of that, pixels and radians. */
FRONTO_API void fronto_move_sides(int64_t n, int64_t k, const double *lines, const double *offset,
                                  const double *t, const double *masks, double *moved,
                                  double *spread, double *seen, double *near, double *turned) {
    for (int64_t i = 0; i < n; i++) {
        const double *l = lines + 12 * i, *m = masks + 12 * i;
        double corner[8], own[8];
        for (int s = 0; s < 4; s++) {
            meet(l + 3 * ((s + 3) % 4), l + 3 * s, corner + 2 * s);
            meet(m + 3 * ((s + 3) % 4), m + 3 * s, own + 2 * s);
        }
        for (int s = 0; s < 4; s++) {
            const int64_t at = 4 * i + s;
            const double *a = corner + 2 * s, *b = corner + 2 * ((s + 1) % 4);
            const double *normal = l + 3 * s;
            double fitted[2], *to = moved + 3 * at;
            fit_offset(k, offset + at * k, t + i * k, fitted, spread + at, seen + at);
            const double x = b[0] - a[0] + fitted[1] * normal[0];
            const double y = b[1] - a[1] + fitted[1] * normal[1];
            const double length = fmax(hypot(x, y), 1e-9);
            to[0] = y / length, to[1] = -x / length;
            to[2] = to[0] * ((a[0] + b[0]) / 2 + fitted[0] * normal[0]) +
                    to[1] * ((a[1] + b[1]) / 2 + fitted[0] * normal[1]);
            const double *c = own + 2 * s, *d = own + 2 * ((s + 1) % 4), *from = m + 3 * s;
            near[at] = fabs(to[0] * (c[0] + d[0]) / 2 + to[1] * (c[1] + d[1]) / 2 - to[2]);
            const double sine = to[0] * from[1] - to[1] * from[0];
            turned[at] = fabs(asin(sine > 1 ? 1 : sine < -1 ? -1 : sine));
        }
    }
}
