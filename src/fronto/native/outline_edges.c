/* Where the edges of masks run, finer than pixels. */
#include <math.h>
#include <stdint.h>

#include "fronto_kernels.h"

/* Where the edge between neighbours inside and outside runs: where their values cross one half,
 * or in the middle where they do not (a closing added one of them). inside, values (rows,
 * columns), whose top-left pixel is at `left`, `top` of a photo (height, width); what lies beyond
 * the array is outside. -> xy (2 * (rows + 1) * (columns + 1), 2) in the photo; border: whether a
 * point lies beyond the photo's outermost pixels; steps (2): sum of the values' steps at the
 * others, and their number. Returns the number of points. */
FRONTO_API int64_t fronto_edge_points(int64_t rows, int64_t columns, const uint8_t *inside,
                                      const float *values, int64_t left, int64_t top,
                                      int64_t height, int64_t width, double *xy, uint8_t *border,
                                      double *steps) {
    int64_t n = 0;
    steps[0] = steps[1] = 0;
    for (int64_t y = 0; y <= rows; y++) {
        const uint8_t *row = y < rows ? inside + y * columns : 0;
        const uint8_t *above = y > 0 ? inside + (y - 1) * columns : 0;
        for (int64_t x = 0; x <= columns; x++) {
            const int in = row && x < columns, here = in && row[x];
            const int other[2] = {row && x > 0 && row[x - 1], above && x < columns && above[x]};
            if (here == other[0] && here == other[1]) continue;
            const double value = in ? values[y * columns + x] : 0.0;
            for (int down = 0; down < 2; down++) {
                if (here == other[down]) continue;
                const int64_t r = y - down, c = x - !down; /* the neighbour before */
                const int known = r >= 0 && c >= 0 && r < rows && c < columns;
                const double before = known ? values[r * columns + c] : 0.0;
                double share = 0.5;
                if ((before - 0.5) * (value - 0.5) <= 0 && before != value)
                    share = (0.5 - before) / (value - before);
                const double u = (double)left + (down ? (double)x : (double)c + share);
                const double v = (double)top + (down ? (double)r + share : (double)y);
                xy[2 * n] = u, xy[2 * n + 1] = v;
                border[n] = u < 0 || v < 0 || u > (double)(width - 1) || v > (double)(height - 1);
                if (!border[n]) steps[0] += fabs(value - before), steps[1] += 1;
                n++;
            }
        }
    }
    return n;
}
