/* Features of the network at points around boxes. */
#include "fronto_kernels.h"

/* features (channels, h, w); boxes of m x m points each: x (n,m), y (n,m), in cells, within the
 * map; out (n, m*m, channels). Between cells it is interpolated linearly. Channel by channel: one
 * plane of the map stays in the cache. */
FRONTO_API void fronto_roi_align(int channels, int h, int w, const float *features, int n, int m,
                                 const float *x, const float *y, float *out) {
    const int most_x = w > 1 ? w - 2 : 0, most_y = h > 1 ? h - 2 : 0;
    const int right = w > 1 ? 1 : 0, below = h > 1 ? w : 0;
    for (int c = 0; c < channels; c++) {
        const float *plane = features + (long)c * h * w;
        for (int k = 0; k < n; k++) {
            for (int i = 0; i < m; i++) {
                const float v = y[(long)k * m + i];
                const int row = (int)v < most_y ? (int)v : most_y;
                const float down = v - (float)row;
                for (int j = 0; j < m; j++) {
                    const float u = x[(long)k * m + j];
                    const int column = (int)u < most_x ? (int)u : most_x;
                    const float across = u - (float)column;
                    const float *p = plane + (long)row * w + column;
                    const float top = p[0] + (p[right] - p[0]) * across;
                    const float bottom = p[below] + (p[below + right] - p[below]) * across;
                    out[(((long)k * m + i) * m + j) * channels + c] = top + (bottom - top) * down;
                }
            }
        }
    }
}
