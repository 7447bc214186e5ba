/* The panel's bundle adjustment: data layout shared by its model and its solver.
 *
 * Coordinates: "normalised" pixels u = K^-1 p (first two rows). A panel point (x, y) is seen
 * at u = s * (d0/d2, d1/d2) with d = t + R^T (x, y, 0), where s = exp(log_focal) is the
 * factor between the true focal length and K's and t = (pivot / s, 1). The panel turns
 * about the pivot, its middle: so (x, y) and the sizes hardly change with the tilt. Turning
 * about the camera (the plane at depth 1) is the same family of views, but its valley is
 * so curved that the optimiser needs ten times as many steps.
 *
 * Global parameters, in this order: w (3, R <- R exp([w]x)), log_focal, then per size
 * group log width and log height (of circles: log diameter, unused; of ovals, ellipses whose
 * axes are the panel's, both), then the latent
 * positions that ties refer to (columns, rows, template offset and scale).
 * Local parameters: (x, y) of each button; they are eliminated (Schur complement).
 */
#ifndef FRONTO_BUNDLE_H
#define FRONTO_BUNDLE_H

#include "fronto_kernels.h"

enum { GLOBALS_BEFORE_GROUPS = 4, TANGENTS = 8, OBSERVATION = 3 * TANGENTS, MAX_GLOBALS = 256 };
enum { QUAD = 0, ELLIPSE = 1 };

typedef struct {
    int buttons, groups, latents, lines;
    double pivot[2];          /* normalised                                                  */
    /* buttons */
    const int *kind;          /* (buttons)    QUAD or ELLIPSE                                */
    const double *observed;   /* (buttons,24) quad: 4 corners (u0,u1), then unused;
                                              ellipse: 8 tangents (n0, n1, h): n.u = h       */
    const double *inverse_sd; /* (buttons,8)  quad: one per corner (first 4), 0 = unseen;
                                              ellipse: one per tangent                       */
    const double *gain;       /* (buttons)    how many times surer its form is than its place
                                              and size; 1: no surer                          */
    const int *group;         /* (buttons)    size group                                     */
    const int *oval;          /* (groups)     1: its ellipses are ovals, 0: circles          */
    const int *tie_index;     /* (buttons,4)  latents of x (2) and of y (2), -1 = none       */
    const double *tie_coef;   /* (buttons,4)  x = sum coef * latent                          */
    const double *tie_isd;    /* (buttons,2)  inverse standard deviation of those two ties   */
    /* segments parallel to the panel's axes */
    const int *axis;          /* (lines)      0 horizontal, 1 vertical                       */
    const double *segment;    /* (lines,4)    p0 p1 q0 q1                                    */
    const double *line_isd;   /* (lines)                                                     */
    /* priors */
    const double *square_isd; /* (groups)     on log width - log height, 0 = none            */
    const double *size_scale; /* (groups,2)   width, height in units of the template's scale
                                              latent, 0 = not tied                           */
    double size_isd;          /* relative, of the template's sizes                           */
    int scale_latent;         /* index of the template's scale latent, -1 = none             */
    double focal_isd;         /* on log_focal; < 0: the focal length is known                */
    double tilt_isd;          /* on R[2][0], R[2][1]                                         */
    /* robustness: Cauchy scales, squared; a button's loss bends only above button_knee */
    double button_knee, button_c2, tie_c2, line_c2;
    int max_iterations;
    double tolerance;
} Problem;

/* One solution; arrays belong to the caller. */
typedef struct {
    double *rotation; /* (9) row-major, in: start, out: solution        */
    double *globals;  /* (4 + 2 groups + latents), [0..2] are always 0   */
    double *xy;       /* (buttons,2)                                     */
    double *chi2;     /* (buttons) squared whitened residuals, out       */
    double *hessian;  /* (m,m) reduced normal matrix at the solution, m = 4 + 2 groups + latents */
    double cost, first_cost;
    int iterations, converged;
} Solution;

/* Cost at the parameters; with `normal` (m*m) and `gradient` (m) given also the normal
 * equations reduced to the globals, and per button what back-substitution needs
 * (elimination: (buttons, 2*m + 2)). Returns infinity where something lies behind
 * the camera or a circle crosses the horizon. */
double bundle_evaluate(const Problem *p, const double *rotation, const double *globals,
                       const double *xy, double lambda, double *normal, double *gradient,
                       double *elimination, double *chi2);

#endif
