/* Residuals and normal equations of the panel's bundle adjustment.
 *
 * Sources: Triggs et al., "Bundle adjustment - a modern synthesis" (2000) for the reduced
 * normal equations and robust reweighting; Hartley & Zisserman, "Multiple View Geometry",
 * for dual conics (2.2.3) and vanishing points (8.6).
 */
#include <math.h>
#include <string.h>

#include "bundle.h"

enum { W0 = 0, FOCAL = 3, WIDTH = 4, HEIGHT = 5, X = 6, Y = 7, COLUMNS = 8 };

static double cauchy(double s, double c2, double *weight) {
    *weight = 1.0 / (1.0 + s / c2);
    return c2 * log1p(s / c2);
}

/* Least squares up to `knee`, from there on Cauchy's loss: no efficiency is lost on what fits. */
static double knee_cauchy(double s, double knee, double c2, double *weight) {
    if (s <= knee) {
        *weight = 1.0;
        return s;
    }
    return knee + cauchy(s - knee, c2, weight);
}

/* A panel point relative to the pivot, e = R^T (x, y, 0), and in the camera frame, d = t + e. */
static void place(const Problem *p, const double *R, double s, double x, double y, double *e,
                  double *d) {
    for (int k = 0; k < 3; k++) e[k] = R[k] * x + R[3 + k] * y;
    d[0] = e[0] + p->pivot[0] / s;
    d[1] = e[1] + p->pivot[1] / s;
    d[2] = e[2] + 1.0;
}

/* Eight residuals of a quad: projected minus observed corners, whitened. */
static int quad_rows(const Problem *p, int i, const double *R, double s, double width,
                     double height, const double *xy, double *r, double (*J)[COLUMNS]) {
    static const double SX[4] = {-0.5, 0.5, 0.5, -0.5}, SY[4] = {-0.5, -0.5, 0.5, 0.5};
    const double *seen = p->observed + (size_t)i * OBSERVATION;
    for (int c = 0; c < 4; c++) {
        const double weight = p->inverse_sd[(size_t)i * TANGENTS + c];
        const double dx = SX[c] * width, dy = SY[c] * height;
        double d[3], e[3];
        place(p, R, s, xy[0] + dx, xy[1] + dy, e, d);
        if (!(d[2] > 1e-6)) return -1;
        const double iz = 1.0 / d[2], a = d[0] * iz, b = d[1] * iz;
        r[2 * c] = weight * (s * a - seen[2 * c]);
        r[2 * c + 1] = weight * (s * b - seen[2 * c + 1]);
        if (!J) continue;
        const double k = weight * s * iz;
        double *J0 = J[2 * c], *J1 = J[2 * c + 1];
        /* d(d)/dw = [e]x, d(u)/d(d) = s/d2 (1 0 -a; 0 1 -b) */
        J0[0] = k * a * e[1], J0[1] = k * (-e[2] - a * e[0]), J0[2] = k * e[1];
        J1[0] = k * (e[2] + b * e[1]), J1[1] = k * -b * e[0], J1[2] = k * -e[0];
        J0[FOCAL] = weight * s * a - k * p->pivot[0] / s;
        J1[FOCAL] = weight * s * b - k * p->pivot[1] / s;
        J0[X] = k * (R[0] - a * R[2]), J1[X] = k * (R[1] - b * R[2]);
        J0[Y] = k * (R[3] - a * R[5]), J1[Y] = k * (R[4] - b * R[5]);
        J0[WIDTH] = J0[X] * dx, J1[WIDTH] = J1[X] * dx;
        J0[HEIGHT] = J0[Y] * dy, J1[HEIGHT] = J1[Y] * dy;
    }
    return 8;
}

/* Multiplies by `gain` what of eight values (corners' x and y, or tangents' distances) is neither
 * a shift of the outline nor its growing; these ways are orthogonal and of length 1, or zero. */
static void sharpen(double gain, const double ways[4][8], double *values, int stride) {
    double along[4] = {0, 0, 0, 0};
    for (int q = 0; q < 4; q++)
        for (int k = 0; k < 8; k++) along[q] += ways[q][k] * values[k * stride];
    for (int k = 0; k < 8; k++) {
        double kept = 0.0;
        for (int q = 0; q < 4; q++) kept += along[q] * ways[q][k];
        values[k * stride] = gain * values[k * stride] - (gain - 1.0) * kept;
    }
}

/* The ways in which a quad on another of a button's edges differs: shifted, or larger along its
 * sides. */
static void quad_ways(const double *seen, double ways[4][8]) {
    static const double SX[4] = {-0.5, 0.5, 0.5, -0.5}, SY[4] = {-0.5, -0.5, 0.5, 0.5};
    double side[2][2] = {{0, 0}, {0, 0}};
    for (int c = 0; c < 4; c++)
        for (int k = 0; k < 2; k++) {
            side[0][k] += SX[c] * seen[2 * c + k];
            side[1][k] += SY[c] * seen[2 * c + k];
        }
    for (int q = 0; q < 2; q++) {
        const double length = hypot(side[q][0], side[q][1]);
        for (int k = 0; k < 2; k++) side[q][k] = length > 0 ? side[q][k] / length : 0.0;
    }
    for (int c = 0; c < 4; c++)
        for (int k = 0; k < 2; k++) {
            ways[0][2 * c + k] = k == 0 ? 0.5 : 0.0;
            ways[1][2 * c + k] = k == 1 ? 0.5 : 0.0;
            ways[2][2 * c + k] = SX[c] * side[0][k];
            ways[3][2 * c + k] = SY[c] * side[1][k];
        }
}

/* The same of an ellipse: shifted, or larger in all. */
static void ellipse_ways(const double *seen, double ways[4][8]) {
    const int half = TANGENTS / 2;
    memset(ways, 0, 4 * sizeof ways[0]);
    for (int t = 0; t < TANGENTS; t++) {
        ways[0][t] = seen[3 * t];
        ways[1][t] = seen[3 * t + 1];
        /* Opposite tangents have opposite normals: their mean is what does not shift. */
        ways[2][t] = 0.5 * (seen[3 * t + 2] + seen[3 * ((t + half) % TANGENTS) + 2]);
    }
    for (int q = 0; q < 3; q++) {
        double square = 0.0;
        for (int before = 0; before < q; before++) {
            double dot = 0.0;
            for (int t = 0; t < TANGENTS; t++) dot += ways[before][t] * ways[q][t];
            for (int t = 0; t < TANGENTS; t++) ways[q][t] -= dot * ways[before][t];
        }
        for (int t = 0; t < TANGENTS; t++) square += ways[q][t] * ways[q][t];
        for (int t = 0; t < TANGENTS; t++) ways[q][t] *= square > 0 ? 1.0 / sqrt(square) : 0.0;
    }
}

/* Eight residuals of an ellipse: along each of eight normals n, the distance between the
 * tangent of the projected circle and the observed one. A line l is tangent to a conic iff
 * l' Q* l = 0 with the dual conic Q* = rho^2 (r1 r1' + r2 r2') - d d'; an oval's half axes are
 * two numbers instead of the one, rho. */
static int ellipse_rows(const Problem *p, int i, const double *R, double s, double width,
                        double height, const double *xy, double *r, double (*J)[COLUMNS]) {
    const double *seen = p->observed + (size_t)i * OBSERVATION;
    const int oval = p->oval[p->group[i]];
    const double wide2 = 0.25 * width * width, high2 = oval ? 0.25 * height * height : wide2;
    double v[3][3], e[3]; /* d, r1, r2 */
    place(p, R, s, xy[0], xy[1], e, v[0]);
    memcpy(v[1], R, 3 * sizeof(double));
    memcpy(v[2], R + 3, 3 * sizeof(double));
    const double A = wide2 * v[1][2] * v[1][2] + high2 * v[2][2] * v[2][2] - v[0][2] * v[0][2];
    if (!(v[0][2] > 1e-6) || !(A < -1e-12)) return -1;
    for (int t = 0; t < TANGENTS; t++) {
        const double nx = s * seen[3 * t], ny = s * seen[3 * t + 1], h_seen = seen[3 * t + 2];
        const double weight = p->inverse_sd[(size_t)i * TANGENTS + t];
        double f[3];
        for (int k = 0; k < 3; k++) f[k] = nx * v[k][0] + ny * v[k][1];
        const double B = wide2 * f[1] * v[1][2] + high2 * f[2] * v[2][2] - f[0] * v[0][2];
        const double C = wide2 * f[1] * f[1] + high2 * f[2] * f[2] - f[0] * f[0];
        const double discriminant = B * B - A * C;
        if (!(discriminant > 0)) return -1;
        const double root = sqrt(discriminant), h = (B - root) / A;
        r[t] = weight * (h - h_seen);
        if (!J) continue;
        /* F(h, parameters) = wide^2 t1^2 + high^2 t2^2 - t0^2 = 0 with t_k = l . v_k;
           dh = -dF / (2 (A h - B)) and A h - B = -root */
        const double k = weight / (2.0 * root);
        double l[3] = {nx, ny, -h}, tk[3], scale[3];
        for (int q = 0; q < 3; q++) tk[q] = f[q] - h * v[q][2];
        scale[0] = -2.0 * tk[0] * k, scale[1] = 2.0 * wide2 * tk[1] * k;
        scale[2] = 2.0 * high2 * tk[2] * k;
        memset(J[t], 0, sizeof J[t]);
        for (int q = 0; q < 3; q++) {
            /* l . (turns x w) = (l x turns) . w; of d only what is not the pivot turns */
            const double *turns = q == 0 ? e : v[q];
            J[t][0] += scale[q] * (l[1] * turns[2] - l[2] * turns[1]);
            J[t][1] += scale[q] * (l[2] * turns[0] - l[0] * turns[2]);
            J[t][2] += scale[q] * (l[0] * turns[1] - l[1] * turns[0]);
            J[t][FOCAL] += scale[q] * f[q];
        }
        J[t][FOCAL] -= scale[0] * (nx * p->pivot[0] + ny * p->pivot[1]) / s;
        J[t][WIDTH] = scale[1] * tk[1] + (oval ? 0.0 : scale[2] * tk[2]);
        J[t][HEIGHT] = oval ? scale[2] * tk[2] : 0.0;
        J[t][X] = scale[0] * tk[1];
        J[t][Y] = scale[0] * tk[2];
    }
    return TANGENTS;
}

/* Adds weight * (row row' , row r) of a residual that touches only globals. */
static void add_global(double *normal, double *gradient, int m, const int *index,
                       const double *row, int count, double r, double weight) {
    for (int a = 0; a < count; a++) {
        gradient[index[a]] += weight * row[a] * r;
        for (int b = 0; b < count; b++)
            normal[(size_t)index[a] * m + index[b]] += weight * row[a] * row[b];
    }
}

static double line_term(const Problem *p, int i, const double *R, double s, double *normal,
                        double *gradient, int m) {
    static const int INDEX[4] = {0, 1, 2, FOCAL};
    const double *e = p->segment + 4 * (size_t)i, *v = R + 3 * p->axis[i];
    const double mx = 0.5 * (e[0] + e[2]), my = 0.5 * (e[1] + e[3]);
    const double dx = 0.5 * (e[0] - e[2]), dy = 0.5 * (e[1] - e[3]);
    const double ux = s * v[0] - mx * v[2], uy = s * v[1] - my * v[2];
    const double norm = sqrt(ux * ux + uy * uy);
    if (norm < 1e-12) return 0.0; /* the segment lies on its vanishing point: no direction */
    const double scale = sqrt(2.0) * p->line_isd[i] / norm, cross = dx * uy - dy * ux;
    const double r = scale * cross;
    double weight;
    const double cost = cauchy(r * r, p->line_c2, &weight);
    if (normal) {
        /* dv/dw = [v]x, by columns */
        const double dv[3][3] = {{0, v[2], -v[1]}, {-v[2], 0, v[0]}, {v[1], -v[0], 0}};
        double row[4];
        for (int k = 0; k < 4; k++) {
            const double gx = k < 3 ? s * dv[k][0] - mx * dv[k][2] : s * v[0];
            const double gy = k < 3 ? s * dv[k][1] - my * dv[k][2] : s * v[1];
            row[k] = scale * (dx * gy - dy * gx - cross * (ux * gx + uy * gy) / (norm * norm));
        }
        add_global(normal, gradient, m, INDEX, row, 4, r, weight);
    }
    return cost;
}

static double prior_terms(const Problem *p, const double *R, const double *globals,
                          double *normal, double *gradient, int m) {
    double cost = 0.0;
    for (int k = 0; k < 2; k++) { /* tilt: d(row 2 of R)/dw = [row]x */
        static const int INDEX[3] = {0, 1, 2};
        const double *v = R + 6, r = p->tilt_isd * v[k];
        const double row[3] = {k == 0 ? 0 : p->tilt_isd * v[2], k == 0 ? -p->tilt_isd * v[2] : 0,
                               k == 0 ? p->tilt_isd * v[1] : -p->tilt_isd * v[0]};
        cost += r * r;
        if (normal) add_global(normal, gradient, m, INDEX, row, 3, r, 1.0);
    }
    if (p->focal_isd > 0) {
        const int index = FOCAL;
        const double r = p->focal_isd * globals[FOCAL];
        cost += r * r;
        if (normal) add_global(normal, gradient, m, &index, &p->focal_isd, 1, r, 1.0);
    }
    for (int g = 0; g < p->groups; g++) {
        const int at = GLOBALS_BEFORE_GROUPS + 2 * g, index[2] = {at, at + 1};
        if (p->square_isd[g] > 0) {
            const double row[2] = {p->square_isd[g], -p->square_isd[g]};
            const double r = p->square_isd[g] * (globals[at] - globals[at + 1]);
            cost += r * r;
            if (normal) add_global(normal, gradient, m, index, row, 2, r, 1.0);
        }
        for (int k = 0; k < 2 && p->scale_latent >= 0; k++) {
            /* known size: log size = log scale + log known */
            const double known = p->size_scale[2 * g + k];
            if (!(known > 0)) continue;
            const int latent = GLOBALS_BEFORE_GROUPS + 2 * p->groups + p->scale_latent;
            const double scale = globals[latent];
            if (!(scale > 0)) return INFINITY;
            const int pair[2] = {at + k, latent};
            const double row[2] = {p->size_isd, -p->size_isd / scale};
            const double r = p->size_isd * (globals[at + k] - log(scale * known));
            cost += r * r;
            if (normal) add_global(normal, gradient, m, pair, row, 2, r, 1.0);
        }
    }
    return cost;
}

/* Eliminates one button's (x, y): H and g hold its 12 parameters' normal equations, the
 * globals' first; `index` maps the first 10 to the globals. */
static void eliminate(const double H[12][12], const double g[12], const int *index, int count,
                      double lambda, double *normal, double *gradient, int m, double *record) {
    const double a = H[10][10] * (1.0 + lambda) + 1e-14, b = H[10][11];
    const double c = H[11][11] * (1.0 + lambda) + 1e-14;
    const double determinant = a * c - b * b;
    const double inverse[3] = {c / determinant, -b / determinant, a / determinant};
    double w[10][2];
    memset(record, 0, sizeof(double) * (2 * (size_t)m + 2));
    const double gx = inverse[0] * g[10] + inverse[1] * g[11];
    const double gy = inverse[1] * g[10] + inverse[2] * g[11];
    for (int k = 0; k < count; k++) {
        w[k][0] = inverse[0] * H[k][10] + inverse[1] * H[k][11];
        w[k][1] = inverse[1] * H[k][10] + inverse[2] * H[k][11];
        record[2 * index[k]] += w[k][0], record[2 * index[k] + 1] += w[k][1];
        gradient[index[k]] += g[k] - H[k][10] * gx - H[k][11] * gy;
    }
    record[2 * m] = gx, record[2 * m + 1] = gy;
    for (int k = 0; k < count; k++)
        for (int q = 0; q < count; q++)
            normal[(size_t)index[k] * m + index[q]] +=
                H[k][q] - H[k][10] * w[q][0] - H[k][11] * w[q][1];
}

double bundle_evaluate(const Problem *p, const double *R, const double *globals, const double *xy,
                       double lambda, double *normal, double *gradient, double *elimination,
                       double *chi2) {
    const int first_latent = GLOBALS_BEFORE_GROUPS + 2 * p->groups;
    const int m = first_latent + p->latents;
    const double s = exp(globals[FOCAL]);
    double cost = 0.0;
    if (normal) {
        memset(normal, 0, sizeof(double) * (size_t)m * m);
        memset(gradient, 0, sizeof(double) * (size_t)m);
    }
    for (int i = 0; i < p->buttons; i++) {
        const int at = GLOBALS_BEFORE_GROUPS + 2 * p->group[i];
        const double width = exp(globals[at]), height = exp(globals[at + 1]);
        double r[8], J[8][COLUMNS];
        const int rows =
            p->kind[i] == QUAD
                ? quad_rows(p, i, R, s, width, height, xy + 2 * i, r, normal ? J : 0)
                : ellipse_rows(p, i, R, s, width, height, xy + 2 * i, r, normal ? J : 0);
        if (rows < 0) return INFINITY;
        if (p->gain[i] != 1.0) {
            double ways[4][8];
            const double *seen = p->observed + (size_t)i * OBSERVATION;
            if (p->kind[i] == QUAD)
                quad_ways(seen, ways);
            else
                ellipse_ways(seen, ways);
            sharpen(p->gain[i], (const double(*)[8])ways, r, 1);
            for (int a = 0; a < COLUMNS && normal; a++)
                sharpen(p->gain[i], (const double(*)[8])ways, &J[0][a], COLUMNS);
        }
        double sum = 0.0, weight;
        for (int k = 0; k < rows; k++) sum += r[k] * r[k];
        if (chi2) chi2[i] = sum;
        cost += knee_cauchy(sum, p->button_knee, p->button_c2, &weight);

        /* parameters of this button: w, focal, width, height, up to 4 latents, x, y */
        double H[12][12], g[12];
        int index[10] = {0, 1, 2, FOCAL, at, at + 1}, count = 6;
        if (normal) {
            static const int PLACE[COLUMNS] = {0, 1, 2, 3, 4, 5, 10, 11};
            memset(H, 0, sizeof H);
            memset(g, 0, sizeof g);
            for (int a = 0; a < COLUMNS; a++) {
                double dot = 0.0;
                for (int k = 0; k < rows; k++) dot += J[k][a] * r[k];
                g[PLACE[a]] = weight * dot;
                for (int b = 0; b <= a; b++) {
                    double sum_ab = 0.0;
                    for (int k = 0; k < rows; k++) sum_ab += J[k][a] * J[k][b];
                    H[PLACE[a]][PLACE[b]] = H[PLACE[b]][PLACE[a]] = weight * sum_ab;
                }
            }
        }
        for (int axis = 0; axis < 2; axis++) {
            const int *tie = p->tie_index + 4 * (size_t)i + 2 * axis;
            const double *coef = p->tie_coef + 4 * (size_t)i + 2 * axis;
            const double isd = p->tie_isd[2 * (size_t)i + axis];
            if (tie[0] < 0 || !(isd > 0)) continue;
            double value = xy[2 * i + axis], tie_weight;
            for (int k = 0; k < 2 && tie[k] >= 0; k++)
                value -= coef[k] * globals[first_latent + tie[k]];
            const double residual = isd * value;
            cost += cauchy(residual * residual, p->tie_c2, &tie_weight);
            if (!normal) continue;
            int place[3] = {10 + axis}, used = 1;
            double row[3] = {isd};
            for (int k = 0; k < 2 && tie[k] >= 0; k++) {
                index[count] = first_latent + tie[k];
                place[used] = count++;
                row[used++] = -isd * coef[k];
            }
            for (int a = 0; a < used; a++) {
                g[place[a]] += tie_weight * row[a] * residual;
                for (int b = 0; b < used; b++)
                    H[place[a]][place[b]] += tie_weight * row[a] * row[b];
            }
        }
        if (normal)
            eliminate((const double(*)[12])H, g, index, count, lambda, normal, gradient, m,
                      elimination + (size_t)i * (2 * m + 2));
    }
    for (int i = 0; i < p->lines; i++) cost += line_term(p, i, R, s, normal, gradient, m);
    cost += prior_terms(p, R, globals, normal, gradient, m);
    return cost;
}
