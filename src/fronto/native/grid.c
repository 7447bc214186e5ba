/* The paper's exhaustive search over rotations (Section IV, Alg. 1), without any storage
 * per rotation.
 *
 * P = R(theta) q + t with R = Rx Ry Rz (Eqs. 3-5). The innermost angle turns the points
 * only in x and y, so the caller hands over those turned points once, and each (theta_x,
 * theta_y) costs one 3x3 product per point and theta_z.
 */
#include <float.h>
#include <math.h>
#include <stdint.h>

#include "fronto_kernels.h"

/* How many theta_z are worked on together: short arrays that stay in the first-level cache. */
#define BLOCK 64

/* Where the numbers of fronto_grid_search's `out` are. */
enum { MIN_H, MIN_V, MIN_C, MAX_H, MAX_V, MAX_C, BEST_H, BEST_V, BEST_C, BEST_CR, OUT_COUNT };

/* Sums of squares over the buttons, and the least third row, for up to BLOCK rotations. */
typedef struct {
    double h[BLOCK], v[BLOCK], c[BLOCK], z[BLOCK];
} sums;

/* Add one button. x, y: its 4 corners turned by theta_z, `stride` apart; z: their depths.
 * a: Rx Ry, row by row; t: translation. The slopes are taken after the division by the third
 * row, written without dividing: (y2/z2 - y1/z1) / (x2/z2 - x1/z1) has z1 z2 > 0 in both. */
static void add_button(const double *x, const double *y, const double *z, int64_t stride,
                       const double a[9], const double t[3], int paper, int count, sums *s)
{
    const double *x2 = x + stride, *x3 = x + 2 * stride, *x4 = x + 3 * stride;
    const double *y2 = y + stride, *y3 = y + 2 * stride, *y4 = y + 3 * stride;
    double c1[3], c2[3], c4[3];
    for (int i = 0; i < 3; i++) {
        c1[i] = a[3 * i + 2] * z[0] + t[i];
        c2[i] = a[3 * i + 2] * z[1] + t[i];
        c4[i] = a[3 * i + 2] * z[3] + t[i];
    }
    const double c3 = a[8] * z[2] + t[2];
    for (int k = 0; k < count; k++) {
        const double px1 = a[0] * x[k] + a[1] * y[k] + c1[0];
        const double py1 = a[3] * x[k] + a[4] * y[k] + c1[1];
        const double pz1 = a[6] * x[k] + a[7] * y[k] + c1[2];
        const double px2 = a[0] * x2[k] + a[1] * y2[k] + c2[0];
        const double py2 = a[3] * x2[k] + a[4] * y2[k] + c2[1];
        const double pz2 = a[6] * x2[k] + a[7] * y2[k] + c2[2];
        const double pz3 = a[6] * x3[k] + a[7] * y3[k] + c3;
        const double px4 = a[0] * x4[k] + a[1] * y4[k] + c4[0];
        const double py4 = a[3] * x4[k] + a[4] * y4[k] + c4[1];
        const double pz4 = a[6] * x4[k] + a[7] * y4[k] + c4[2];

        const double hx = px2 * pz1 - px1 * pz2, hy = py2 * pz1 - py1 * pz2;
        const double vx = px4 * pz1 - px1 * pz4, vy = py4 * pz1 - py1 * pz4;
        const double slope_h = hy / hx;
        const double slope_v = paper ? vy / vx : vx / vy;
        const double dot = hx * vx + hy * vy;
        s->h[k] += slope_h * slope_h;
        s->v[k] += slope_v * slope_v;
        s->c[k] += dot * dot / ((hx * hx + hy * hy) * (vx * vx + vy * vy));

        const double near12 = pz1 < pz2 ? pz1 : pz2, near34 = pz3 < pz4 ? pz3 : pz4;
        const double nearest = near12 < near34 ? near12 : near34;
        s->z[k] = nearest < s->z[k] ? nearest : s->z[k];
    }
}

/* Norms from the sums (Eqs. 9, 11, 13). */
static void take_norms(sums *s, int paper, int count)
{
    for (int k = 0; k < count; k++) {
        const double v = sqrt(s->v[k]);
        s->h[k] = sqrt(s->h[k]);
        s->v[k] = paper ? 1.0 / v : v;
        s->c[k] = sqrt(s->c[k]);
    }
}

/* Widen a criterion's range; infinite values (a line turned exactly upright) are left out,
 * for no normalisation could use them. */
static void widen(double value, double *least, double *most)
{
    if (value < *least)
        *least = value;
    if (value > *most && value <= DBL_MAX)
        *most = value;
}

/* Search n^3 rotations for the least (K_H - offset) / span summed over the three criteria.
 *
 * cosine, sine (n): of the angles, the same for each axis.
 * x, y (4 buttons, n): the corners q turned by each theta_z; z (4 buttons): their third row.
 * t (3): translation added before the division; min_depth: third rows at or below it are
 * behind the camera and drop the rotation. paper: K_rV = 1/||K_V||, else ||1/k_v||.
 * offset, span (3): of the sum; 0 and 1 for the plain one.
 * out (OUT_COUNT): ranges of the criteria, and the criteria and the sum at the best rotation.
 * evaluated: rotations that keep every corner in front of the camera.
 *
 * Returns the best rotation's number (theta_x outermost; the first of equal ones), or -1
 * where there is none. */
FRONTO_API int64_t fronto_grid_search(int64_t n, const double *cosine, const double *sine,
                                      int64_t buttons, const double *x, const double *y,
                                      const double *z, const double *t, double min_depth,
                                      int paper, const double *offset, const double *span,
                                      double *out, int64_t *evaluated)
{
    int64_t best = -1, seen = 0;
    double best_cr = INFINITY;
    sums s;
    for (int i = 0; i < 3; i++) {
        out[MIN_H + i] = INFINITY;
        out[MAX_H + i] = -INFINITY;
    }
    for (int64_t i = 0; i < n; i++) {
        for (int64_t j = 0; j < n; j++) {
            const double cx = cosine[i], sx = sine[i], cy = cosine[j], sy = sine[j];
            const double a[9] = {cy,      0.0, -sy,     /* Rx Ry */
                                 sx * sy, cx,  sx * cy, /* */
                                 cx * sy, -sx, cx * cy};
            for (int64_t first = 0; first < n; first += BLOCK) {
                const int count = n - first < BLOCK ? (int)(n - first) : BLOCK;
                for (int k = 0; k < count; k++) {
                    s.h[k] = s.v[k] = s.c[k] = 0.0;
                    s.z[k] = INFINITY;
                }
                for (int64_t b = 0; b < buttons; b++)
                    add_button(x + 4 * b * n + first, y + 4 * b * n + first, z + 4 * b, n, a, t,
                               paper, count, &s);
                take_norms(&s, paper, count);
                for (int k = 0; k < count; k++) {
                    if (!(s.z[k] > min_depth))
                        continue;
                    seen++;
                    widen(s.h[k], &out[MIN_H], &out[MAX_H]);
                    widen(s.v[k], &out[MIN_V], &out[MAX_V]);
                    widen(s.c[k], &out[MIN_C], &out[MAX_C]);
                    const double cr = (s.h[k] - offset[0]) / span[0] +
                                      (s.v[k] - offset[1]) / span[1] +
                                      (s.c[k] - offset[2]) / span[2];
                    if (cr < best_cr) {
                        best_cr = cr;
                        best = (i * n + j) * n + first + k;
                        out[BEST_H] = s.h[k];
                        out[BEST_V] = s.v[k];
                        out[BEST_C] = s.c[k];
                    }
                }
            }
        }
    }
    out[BEST_CR] = best_cr;
    *evaluated = seen;
    return best;
}
