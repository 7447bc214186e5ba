/* Levenberg-Marquardt on the reduced normal equations, from several starts.
 *
 * Nielsen's damping (Madsen, Nielsen & Tingleff, "Methods for non-linear least squares
 * problems", 2004, section 3.2).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bundle.h"

/* Cholesky in place of the lower triangle; 0 if not positive definite. */
static int cholesky(double *a, int n) {
    for (int j = 0; j < n; j++) {
        for (int i = j; i < n; i++) {
            double sum = a[i * n + j];
            for (int k = 0; k < j; k++) sum -= a[i * n + k] * a[j * n + k];
            if (i == j) {
                if (!(sum > 0)) return 0;
                a[j * n + j] = sqrt(sum);
            } else {
                a[i * n + j] = sum / a[j * n + j];
            }
        }
    }
    return 1;
}

static void solve_cholesky(const double *a, int n, double *b) {
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++) b[i] -= a[i * n + k] * b[k];
        b[i] /= a[i * n + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) b[i] -= a[k * n + i] * b[k];
        b[i] /= a[i * n + i];
    }
}

/* R exp([w]x), Rodrigues' formula. */
static void turn(const double *R, const double *w, double *out) {
    const double angle2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], angle = sqrt(angle2);
    const double a = angle > 1e-8 ? sin(angle) / angle : 1.0 - angle2 / 6.0;
    const double b = angle > 1e-8 ? (1.0 - cos(angle)) / angle2 : 0.5 - angle2 / 24.0;
    const double c = 1.0 - b * angle2;
    const double E[9] = {c + b * w[0] * w[0],        b * w[0] * w[1] - a * w[2],
                         b * w[0] * w[2] + a * w[1], b * w[0] * w[1] + a * w[2],
                         c + b * w[1] * w[1],        b * w[1] * w[2] - a * w[0],
                         b * w[0] * w[2] - a * w[1], b * w[1] * w[2] + a * w[0],
                         c + b * w[2] * w[2]};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out[3 * i + j] = R[3 * i] * E[j] + R[3 * i + 1] * E[3 + j] + R[3 * i + 2] * E[6 + j];
}

typedef struct {
    double *normal, *factor, *gradient, *step, *elimination, *globals, *xy;
    int *fixed;
} Workspace;

static int allocate(Workspace *w, int m, int buttons) {
    const size_t mm = (size_t)m * m, doubles = 2 * mm + 3 * (size_t)m +
                                              (size_t)buttons * (2 * m + 2) + 2 * (size_t)buttons;
    w->normal = malloc(doubles * sizeof(double));
    w->fixed = malloc((size_t)m * sizeof(int));
    if (!w->normal || !w->fixed) return 0;
    w->factor = w->normal + mm;
    w->gradient = w->factor + mm;
    w->step = w->gradient + m;
    w->globals = w->step + m;
    w->xy = w->globals + m;
    w->elimination = w->xy + 2 * (size_t)buttons;
    return 1;
}

/* Parameters that no residual touches stay where they are: rows of zeros become unit rows. */
static void hold_untouched(const Problem *p, double *normal, double *gradient, int *fixed, int m) {
    for (int k = 0; k < m; k++) {
        fixed[k] = (k == 3 && p->focal_isd < 0) || !(normal[(size_t)k * m + k] > 1e-9);
        if (!fixed[k]) continue;
        for (int q = 0; q < m; q++) normal[(size_t)k * m + q] = normal[(size_t)q * m + k] = 0.0;
        normal[(size_t)k * m + k] = 1.0;
        gradient[k] = 0.0;
    }
}

static void refine(const Problem *p, Solution *s, Workspace *w) {
    const int m = GLOBALS_BEFORE_GROUPS + 2 * p->groups + p->latents, n = p->buttons;
    double lambda = 1e-3, growth = 2.0, cost;
    s->converged = 0;
    s->iterations = 0;
    cost = bundle_evaluate(p, s->rotation, s->globals, s->xy, 0.0, 0, 0, 0, s->chi2);
    s->first_cost = cost;
    while (isfinite(cost) && s->iterations < p->max_iterations) {
        bundle_evaluate(p, s->rotation, s->globals, s->xy, lambda, w->normal, w->gradient,
                        w->elimination, s->chi2);
        hold_untouched(p, w->normal, w->gradient, w->fixed, m);
        for (;;) {
            s->iterations++;
            memcpy(w->factor, w->normal, sizeof(double) * (size_t)m * m);
            for (int k = 0; k < m; k++) w->factor[k * m + k] *= 1.0 + lambda;
            double trial = INFINITY, predicted = INFINITY, R[9];
            if (cholesky(w->factor, m)) {
                predicted = 0.0;
                memcpy(w->step, w->gradient, sizeof(double) * m);
                solve_cholesky(w->factor, m, w->step);
                for (int k = 0; k < m; k++) {
                    predicted += w->step[k] * w->gradient[k];
                    w->step[k] = -w->step[k];
                    w->globals[k] = s->globals[k] + (k < 3 ? 0.0 : w->step[k]);
                }
                turn(s->rotation, w->step, R);
                for (int i = 0; i < n; i++) {
                    const double *e = w->elimination + (size_t)i * (2 * m + 2);
                    double x = -e[2 * m], y = -e[2 * m + 1];
                    for (int k = 0; k < m; k++) {
                        x -= e[2 * k] * w->step[k];
                        y -= e[2 * k + 1] * w->step[k];
                    }
                    w->xy[2 * i] = s->xy[2 * i] + x;
                    w->xy[2 * i + 1] = s->xy[2 * i + 1] + y;
                }
                trial = bundle_evaluate(p, R, w->globals, w->xy, 0.0, 0, 0, 0, 0);
            }
            const double gain = cost - trial;
            if (gain >= 0) {
                memcpy(s->rotation, R, sizeof R);
                memcpy(s->globals, w->globals, sizeof(double) * m);
                memcpy(s->xy, w->xy, sizeof(double) * 2 * n);
                cost = trial;
                lambda = fmax(1e-9, lambda * (gain > 0.75 * predicted ? 0.1 : 0.4));
                growth = 2.0;
                if (gain <= p->tolerance) s->converged = 1;
                break;
            }
            /* Only an undamped step can tell that there is nothing left to gain. */
            if (lambda <= 1e-3 && predicted < p->tolerance) {
                s->converged = 1;
                break;
            }
            lambda *= growth;
            growth *= 2.0;
            if (lambda > 1e12 || s->iterations >= p->max_iterations) break;
            bundle_evaluate(p, s->rotation, s->globals, s->xy, lambda, w->normal, w->gradient,
                            w->elimination, s->chi2);
            hold_untouched(p, w->normal, w->gradient, w->fixed, m);
        }
        if (s->converged || lambda > 1e12) break;
    }
    s->cost = cost;
    if (isfinite(cost)) {
        bundle_evaluate(p, s->rotation, s->globals, s->xy, 0.0, w->normal, w->gradient,
                        w->elimination, s->chi2);
        hold_untouched(p, w->normal, w->gradient, w->fixed, m);
        memcpy(s->hessian, w->normal, sizeof(double) * (size_t)m * m);
    }
}

/* Refines every start in place. Returns 0, or 1 without memory, or 2 for too many globals. */
FRONTO_API int fronto_bundle(const Problem *p, Solution *solutions, int starts) {
    const int m = GLOBALS_BEFORE_GROUPS + 2 * p->groups + p->latents;
    Workspace w = {0};
    if (m > MAX_GLOBALS) return 2;
    const int have = allocate(&w, m, p->buttons);
    if (have)
        for (int k = 0; k < starts; k++) refine(p, solutions + k, &w);
    free(w.normal);
    free(w.fixed);
    return have ? 0 : 1;
}

/* Cost of given parameters, for tests of the derivatives. */
FRONTO_API double fronto_bundle_cost(const Problem *p, const double *rotation,
                                     const double *globals, const double *xy) {
    return bundle_evaluate(p, rotation, globals, xy, 0.0, 0, 0, 0, 0);
}
