/* How far the edge points of masks are from the shapes that they may have.
 *
 * Points of mask i are xy[first[i]] .. xy[first[i + 1] - 1], of which every every[i]-th is looked
 * at; those on the photo's border say nothing of the shape. Misfits are means of squared
 * distances, pixels, none of them counted as more than limit[i]; NaN where no point counts. */
#include <math.h>
#include <stdint.h>

#include "fronto_kernels.h"

enum { MOST_SHAPES = 16 };

static double length(double x, double y) { return sqrt(x * x + y * y); }

static double least(double a, double b) { return a < b ? a : b; }

/* From the photo to where the quad's corners are (-1, -1), (1, -1), (1, 1), (-1, 1): inverse of
 * the closed form of Heckbert, "Fundamentals of Texture Mapping", 1989, Section 2.2.3. Without a
 * quad twice the photo's coordinates less one. */
static void into_square(const double *c, double *inverse) {
    const double d1x = c[2] - c[4], d1y = c[3] - c[5], d2x = c[6] - c[4], d2y = c[7] - c[5];
    const double sx = c[0] - c[2] + c[4] - c[6], sy = c[1] - c[3] + c[5] - c[7];
    const double det = d1x * d2y - d1y * d2x;
    const double g = (sx * d2y - sy * d2x) / det, h = (d1x * sy - d1y * sx) / det;
    double m[9] = {c[2] - c[0] + g * c[2], c[6] - c[0] + h * c[6], c[0],
                   c[3] - c[1] + g * c[3], c[7] - c[1] + h * c[7], c[1], g, h, 1};
    for (int k = 0; k < 9; k++)
        if (!isfinite(m[k])) {
            for (int j = 0; j < 9; j++) m[j] = j % 4 == 0;
            break;
        }
    for (int r = 0; r < 3; r++) { /* the unit square is half as large and begins at 0 */
        m[3 * r + 2] += (m[3 * r] + m[3 * r + 1]) / 2;
        m[3 * r] /= 2, m[3 * r + 1] /= 2;
    }
    inverse[0] = m[4] * m[8] - m[5] * m[7], inverse[1] = m[2] * m[7] - m[1] * m[8];
    inverse[2] = m[1] * m[5] - m[2] * m[4], inverse[3] = m[5] * m[6] - m[3] * m[8];
    inverse[4] = m[0] * m[8] - m[2] * m[6], inverse[5] = m[2] * m[3] - m[0] * m[5];
    inverse[6] = m[3] * m[7] - m[4] * m[6], inverse[7] = m[1] * m[6] - m[0] * m[7];
    inverse[8] = m[0] * m[4] - m[1] * m[3];
    const double whole = m[0] * inverse[0] + m[1] * inverse[3] + m[2] * inverse[6];
    for (int k = 0; k < 9; k++) inverse[k] /= whole;
}

static void place(const double *inverse, const double *p, double *u, double *v) {
    const double w = inverse[6] * p[0] + inverse[7] * p[1] + inverse[8];
    *u = (inverse[0] * p[0] + inverse[1] * p[1] + inverse[2]) / w;
    *v = (inverse[3] * p[0] + inverse[4] * p[1] + inverse[5]) / w;
}

static void half_sides(const double *c, double *half) {
    for (int k = 0; k < 2; k++) {
        const double *a = c + 2 * k, *b = c + 2 * k + 2, *d = c + 2 * k + 4, *e = c + (2 * k + 6) % 8;
        half[k] = (length(b[0] - a[0], b[1] - a[1]) + length(e[0] - d[0], e[1] - d[1])) / 4;
    }
}

/* Quads (n,4,2) with each of m corner radii, in half sides -> misfit (n, m). */
FRONTO_API void fronto_rounded_misfits(int64_t n, const int64_t *first, const double *xy,
                                       const uint8_t *border, const int64_t *every,
                                       const double *limit, const double *corners, int64_t m,
                                       const double *radii, double *misfit) {
    for (int64_t i = 0; i < n; i++) {
        double inverse[9], half[2], sum[MOST_SHAPES] = {0};
        int64_t number = 0;
        into_square(corners + 8 * i, inverse);
        half_sides(corners + 8 * i, half);
        const double mean = (half[0] + half[1]) / 2;
        for (int64_t p = first[i]; p < first[i + 1]; p += every[i]) {
            double u, v;
            if (border[p]) continue;
            place(inverse, xy + 2 * p, &u, &v);
            u = fabs(u), v = fabs(v), number++;
            for (int64_t k = 0; k < m; k++) {
                const double du = u - (1 - radii[k]), dv = v - (1 - radii[k]);
                /* along a side its own half length is the unit, in a corner their mean */
                const double off = du > 0 && dv > 0 ? (length(du, dv) - radii[k]) * mean
                                   : du > dv        ? (u - 1) * half[0]
                                                    : (v - 1) * half[1];
                sum[k] += off == off ? least(off * off, limit[i]) : NAN;
            }
        }
        for (int64_t k = 0; k < m; k++) misfit[i * m + k] = sum[k] / (double)number;
    }
}

/* Stadiums in the quads' directions, whose round ends are m different shares of a half shorter
 * side long (seen from the side, half circles are half ellipses) -> misfit (n, m); bounds (n, 4)
 * of all points where the corners are (+-1, +-1): lowest u, v, highest u, v; sides (n, 2): half
 * width and half height of these bounds, pixels. */
FRONTO_API void fronto_pill_misfits(int64_t n, const int64_t *first, const double *xy,
                                    const uint8_t *border, const int64_t *every,
                                    const double *limit, const double *corners, int64_t m,
                                    const double *caps, double *misfit, double *bounds,
                                    double *sides) {
    for (int64_t i = 0; i < n; i++) {
        double inverse[9], half[2], sum[MOST_SHAPES] = {0}, *b = bounds + 4 * i;
        int64_t number = 0;
        into_square(corners + 8 * i, inverse);
        half_sides(corners + 8 * i, half);
        b[0] = b[1] = INFINITY, b[2] = b[3] = -INFINITY;
        for (int64_t p = first[i]; p < first[i + 1]; p += every[i]) {
            double u, v;
            place(inverse, xy + 2 * p, &u, &v);
            if (u < b[0]) b[0] = u;
            if (v < b[1]) b[1] = v;
            if (u > b[2]) b[2] = u;
            if (v > b[3]) b[3] = v;
        }
        const double a = half[0] * (b[2] - b[0]) / 2, c = half[1] * (b[3] - b[1]) / 2;
        sides[2 * i] = a, sides[2 * i + 1] = c;
        const int wide = a >= c;
        const double longer = wide ? a : c, shorter = wide ? c : a;
        for (int64_t p = first[i]; p < first[i + 1]; p += every[i]) {
            double u, v;
            if (border[p]) continue;
            place(inverse, xy + 2 * p, &u, &v);
            const double x = fabs(u - (b[0] + b[2]) / 2) * half[0];
            const double y = fabs(v - (b[1] + b[3]) / 2) * half[1];
            const double along = wide ? x : y, across = wide ? y : x;
            number++;
            for (int64_t k = 0; k < m; k++) {
                const double cap = caps[k] * shorter, beyond = (along - longer + cap) / cap;
                const double off = beyond > 0 ? (length(beyond, across / shorter) - 1) * (cap + shorter) / 2
                                              : across - shorter;
                sum[k] += off == off ? least(off * off, limit[i]) : NAN;
            }
        }
        for (int64_t k = 0; k < m; k++) misfit[i * m + k] = sum[k] / (double)number;
    }
}

/* Ellipses (n,5): centre and m11, m12, m22 -> misfit (n); wave (n): height of the highest of
 * some waves around them that the points' distances make, pixels: polygons have as many as
 * sides. waves (m): how many there may be in a turn, growing. */
FRONTO_API void fronto_ellipse_misfits(int64_t n, const int64_t *first, const double *xy,
                                       const uint8_t *border, const int64_t *every,
                                       const double *limit, const double *shape, int64_t m,
                                       const int64_t *waves, double *misfit, double *wave) {
    for (int64_t i = 0; i < n; i++) {
        const double *s = shape + 5 * i;
        const double root = sqrt(s[2]), other = sqrt(s[4] - s[3] * s[3] / s[2]);
        double sum = 0, re[MOST_SHAPES] = {0}, im[MOST_SHAPES] = {0};
        int64_t number = 0, all = 0;
        for (int64_t p = first[i]; p < first[i + 1]; p += every[i]) {
            const double dx = xy[2 * p] - s[0], dy = xy[2 * p + 1] - s[1];
            const double gx = s[2] * dx + s[3] * dy, gy = s[3] * dx + s[4] * dy;
            const double q = sqrt(dx * gx + dy * gy), off = (q - 1) * q / length(gx, gy);
            all++;
            if (border[p]) continue;
            number++;
            sum += off == off ? least(off * off, limit[i]) : NAN;
            /* the affine map that makes the ellipse a circle, up to a rotation */
            const double x = dx * root + dy * s[3] / root, y = dy * other, r = length(x, y);
            if (!(r > 0) || !(off == off)) continue;
            const double cosine = x / r, sine = y / r;
            double c = 1, d = 0;
            int64_t turn = 0;
            for (int64_t k = 0; k < m; k++) {
                for (; turn < waves[k]; turn++) {
                    const double next = c * cosine - d * sine;
                    d = c * sine + d * cosine, c = next;
                }
                re[k] += off * c, im[k] += off * d;
            }
        }
        misfit[i] = sum / (double)number, wave[i] = 0;
        for (int64_t k = 0; k < m; k++) wave[i] = fmax(wave[i], 2 * length(re[k], im[k]) / (double)all);
    }
}
