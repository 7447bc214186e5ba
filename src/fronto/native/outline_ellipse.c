/* Ellipses through the edge points of masks, one mask after the other.
 *
 * Points of mask i are xy[first[i]] .. xy[first[i + 1] - 1], in pixels. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "fronto_kernels.h"
#include "robust.h"

enum { PARAMETERS = 5 };

/* Distance of a point from the ellipse (Sampson's approximation, of q - 1 with
 * q^2 = (p - c)' M (p - c), which stays nearly linear far away), and its derivatives. */
static double sampson(const double *s, double x, double y, double *jacobian) {
    const double dx = x - s[0], dy = y - s[1];
    const double gx = s[2] * dx + s[3] * dy, gy = s[3] * dx + s[4] * dy;
    const double q2 = dx * gx + dy * gy, g = sqrt(gx * gx + gy * gy);
    if (!(q2 > 1e-12) || !(g > 1e-12)) {
        for (int k = 0; k < PARAMETERS; k++) jacobian[k] = 0;
        return -1e-3;
    }
    const double q = sqrt(q2);
    jacobian[0] = -gx / g, jacobian[1] = -gy / g;
    jacobian[2] = dx * dx / (2 * g), jacobian[3] = dx * dy / g, jacobian[4] = dy * dy / (2 * g);
    return (q - 1) * q / g;
}

/* Inverse of a symmetric positive definite 5x5 matrix, scaled to a unit diagonal first. */
static int invert(const double *a, double *out) {
    double L[25] = {0}, d[5], inv[25] = {0};
    for (int i = 0; i < 5; i++) {
        if (!(a[6 * i] > 0)) return 0;
        d[i] = 1 / sqrt(a[6 * i]);
    }
    for (int i = 0; i < 5; i++)
        for (int j = 0; j <= i; j++) {
            double s = a[5 * i + j] * d[i] * d[j];
            for (int k = 0; k < j; k++) s -= L[5 * i + k] * L[5 * j + k];
            if (i == j) {
                if (!(s > 1e-10)) return 0;
                L[6 * i] = sqrt(s);
            } else
                L[5 * i + j] = s / L[6 * j];
        }
    for (int j = 0; j < 5; j++) { /* inv = L^-1 */
        inv[6 * j] = 1 / L[6 * j];
        for (int i = j + 1; i < 5; i++) {
            double s = 0;
            for (int k = j; k < i; k++) s -= L[5 * i + k] * inv[5 * k + j];
            inv[5 * i + j] = s / L[6 * i];
        }
    }
    for (int i = 0; i < 5; i++)
        for (int j = 0; j < 5; j++) {
            double s = 0;
            for (int k = i > j ? i : j; k < 5; k++) s += inv[5 * k + i] * inv[5 * k + j];
            out[5 * i + j] = s * d[i] * d[j];
        }
    return 1;
}

static int is_ellipse(const double *s) {
    return s[2] > 0 && s[2] * s[4] - s[3] * s[3] > 1e-9 * s[2] * s[4] && s[0] == s[0] && s[1] == s[1];
}

/* From the second moments: points spread evenly along a circle have variance r^2 / 2. */
static void start_ellipse(int64_t n, const double *p, double *s) {
    double mx = 0, my = 0, xx = 0, xy = 0, yy = 0;
    for (int64_t i = 0; i < n; i++) mx += p[2 * i], my += p[2 * i + 1];
    mx /= n, my /= n;
    for (int64_t i = 0; i < n; i++) {
        const double dx = p[2 * i] - mx, dy = p[2 * i + 1] - my;
        xx += 2 * dx * dx / n, xy += 2 * dx * dy / n, yy += 2 * dy * dy / n;
    }
    const double det = xx * yy - xy * xy;
    s[0] = mx, s[1] = my, s[2] = yy / det, s[3] = -xy / det, s[4] = xx / det;
}

/* work: 2 n + 5 n numbers. */
static int fit_ellipse(int64_t n, const double *p, double *s, double *rms, double *inverse,
                       double still, double *work) {
    double *distance = work, *sorted = work + n, *jacobians = work + 2 * n;
    for (int round = 0; round < ROUNDS; round++) {
        double normal[25] = {0}, right[5] = {0}, total = 0, sum = 0, step[5], moved = 0;
        for (int64_t i = 0; i < n; i++) {
            distance[i] = sampson(s, p[2 * i], p[2 * i + 1], jacobians + 5 * i);
            sorted[i] = fabs(distance[i]);
        }
        const double sigma = fmax(1.4826 * select_kth(sorted, n, n / 2), FLOOR_PX);
        const double reach = 1 / (TUKEY * sigma);
        for (int64_t i = 0; i < n; i++) {
            const double d = distance[i], w = weight(d, reach), *j = jacobians + 5 * i;
            total += w, sum += w * d * d;
            for (int a = 0; a < 5; a++) {
                const double share = w * j[a];
                right[a] += share * d;
                for (int b = 0; b <= a; b++) normal[5 * a + b] += share * j[b];
            }
        }
        for (int a = 0; a < 5; a++)
            for (int b = a + 1; b < 5; b++) normal[5 * a + b] = normal[5 * b + a];
        if (!invert(normal, inverse)) return 0;
        *rms = sqrt(sum / total);
        for (int a = 0; a < 5; a++) {
            step[a] = 0;
            for (int b = 0; b < 5; b++) step[a] -= inverse[5 * a + b] * right[b];
        }
        for (int half = 0;; half++) {
            double next[5];
            for (int a = 0; a < 5; a++) next[a] = s[a] + step[a];
            if (is_ellipse(next)) {
                moved = hypot(step[0], step[1]) + fabs(step[2]) / s[2] + fabs(step[4]) / s[4];
                for (int a = 0; a < 5; a++) s[a] = next[a];
                break;
            }
            if (half == 8) return 0;
            for (int a = 0; a < 5; a++) step[a] /= 2;
        }
        if (moved < still) break;
    }
    return 1;
}

/* still: an ellipse that moves by less, in pixels and as a share of its shape, is good enough.
 * Points on the photo's border do not count; of the others of group i every every[i]-th is looked at.
 * shape (n,5): centre and m11, m12, m22; in: a start, or NaN to find one; out: NaN where there
 * is no ellipse. rms (n) of the distances; inverse (n,25) of the normal matrix. Returns 0
 * if memory ran out. */
FRONTO_API int fronto_fit_ellipses(int64_t n, double still, const int64_t *first, const double *xy,
                                   const uint8_t *border, const int64_t *every, double *shape,
                                   double *rms, double *inverse) {
    int64_t most = 1;
    for (int64_t i = 0; i < n; i++)
        if (first[i + 1] - first[i] > most) most = first[i + 1] - first[i];
    double *work = malloc((4 + PARAMETERS) * (size_t)most * sizeof *work);
    if (!work) return 0;
    double *p = work + (2 + PARAMETERS) * most;
    for (int64_t i = 0; i < n; i++) {
        int64_t points = 0;
        for (int64_t j = first[i]; j < first[i + 1]; j += every[i])
            if (!border[j]) p[2 * points] = xy[2 * j], p[2 * points + 1] = xy[2 * j + 1], points++;
        double *s = shape + 5 * i;
        if (points >= 6 && !(s[0] == s[0])) start_ellipse(points, p, s);
        if (points >= 6 && is_ellipse(s) &&
            fit_ellipse(points, p, s, rms + i, inverse + 25 * i, still, work))
            continue;
        for (int k = 0; k < 5; k++) s[k] = NAN;
        for (int k = 0; k < 25; k++) inverse[25 * i + k] = NAN;
        rms[i] = NAN;
    }
    free(work);
    return 1;
}
