/* Outlines back onto the panel's plane, one by one, for given rotations: where the bundle
 * adjustment starts, and what the sizes of the buttons are measured with. */
#include <math.h>

#include "bundle.h"

/* Below this third coordinate a rotation sees the panel edge-on or from behind. */
static const double FRONT = 0.05;

static double on_plane(const double *R, double u0, double u1, double *xy) {
    const double z = R[6] * u0 + R[7] * u1 + R[8], depth = z > FRONT ? z : FRONT;
    xy[0] = (R[0] * u0 + R[1] * u1 + R[2]) / depth;
    xy[1] = (R[3] * u0 + R[4] * u1 + R[5]) / depth;
    return depth;
}

/* Centre of an ellipse from its eight tangents, and half its extent along two conjugate
 * directions: tangents 0 and 4, 2 and 6 are parallel. */
static void ellipse_center(const double *t, double *center, double *reach) {
    const double a = t[0], b = t[1], c = t[6], d = t[7];
    const double h0 = 0.5 * (t[2] - t[14]), h1 = 0.5 * (t[8] - t[20]), det = a * d - b * c;
    center[0] = (d * h0 - b * h1) / det;
    center[1] = (a * h1 - c * h0) / det;
    *reach = 0.5 * sqrt((t[2] + t[14]) * (t[8] + t[20]));
}

/* Turns R within the plane so that the mean direction of the quads' sides is upright. */
static void turn_upright(int n, const int *kind, const double *observed, double s, double *R) {
    double x = 0.0, y = 0.0;
    for (int i = 0; i < n; i++) {
        const double *o = observed + (long)i * OBSERVATION;
        double c[4][2];
        if (kind[i] != QUAD) continue;
        for (int q = 0; q < 4; q++) on_plane(R, o[2 * q] / s, o[2 * q + 1] / s, c[q]);
        /* a quarter turn back makes the vertical sides vote for the same direction */
        x += (c[1][0] - c[0][0] + c[2][0] - c[3][0]) + (c[3][1] - c[0][1] + c[2][1] - c[1][1]);
        y += (c[1][1] - c[0][1] + c[2][1] - c[3][1]) - (c[3][0] - c[0][0] + c[2][0] - c[1][0]);
    }
    const double length = sqrt(x * x + y * y);
    if (!(length > 0)) return;
    for (int q = 0; q < 3; q++) {
        const double row0 = R[q], row1 = R[3 + q];
        R[q] = (x * row0 + y * row1) / length;
        R[3 + q] = (x * row1 - y * row0) / length;
    }
}

/* For each of `count` rotations: centres xy (n,2), log sizes (n,2; of circles both the
 * diameter), in units of the pivot's depth and from the pivot. Rotations from `keep` on
 * are turned upright first, in place. s: true focal length over K's. */
FRONTO_API void fronto_back_project(int n, const int *kind, const double *observed,
                                    const double *pivot, int count, int keep, double *rotations,
                                    double s, double *xy, double *log_size) {
    for (int k = 0; k < count; k++) {
        if (k >= keep) turn_upright(n, kind, observed, s, rotations + 9 * k);
        const double *R = rotations + 9 * k, p0 = pivot[0] / s, p1 = pivot[1] / s;
        const double shift[2] = {R[0] * p0 + R[1] * p1 + R[2], R[3] * p0 + R[4] * p1 + R[5]};
        const double h = R[6] * p0 + R[7] * p1 + R[8], unit = h > FRONT ? h : FRONT;
        for (int i = 0; i < n; i++) {
            const double *o = observed + (long)i * OBSERVATION;
            double *center = xy + 2 * ((long)k * n + i), *size = log_size + 2 * ((long)k * n + i);
            if (kind[i] == QUAD) {
                double c[4][2];
                for (int q = 0; q < 4; q++) on_plane(R, o[2 * q] / s, o[2 * q + 1] / s, c[q]);
                const double ax = c[1][0] - c[0][0] + c[2][0] - c[3][0];
                const double ay = c[1][1] - c[0][1] + c[2][1] - c[3][1];
                const double dx = c[3][0] - c[0][0] + c[2][0] - c[1][0];
                const double dy = c[3][1] - c[0][1] + c[2][1] - c[1][1];
                for (int q = 0; q < 2; q++)
                    center[q] = 0.25 * (c[0][q] + c[1][q] + c[2][q] + c[3][q]) * unit - shift[q];
                size[0] = log(0.5 * unit * sqrt(ax * ax + ay * ay) + 1e-12);
                size[1] = log(0.5 * unit * sqrt(dx * dx + dy * dy) + 1e-12);
            } else {
                double c[2], reach;
                ellipse_center(o, c, &reach);
                const double depth = on_plane(R, c[0] / s, c[1] / s, center);
                for (int q = 0; q < 2; q++) center[q] = center[q] * unit - shift[q];
                /* under a pure rotation areas scale with 1 / depth^3, diameters with its root */
                size[0] = size[1] = log(2.0 * reach / s * unit) - 1.5 * log(depth);
            }
        }
    }
}
