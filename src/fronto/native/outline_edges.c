/* Where the edges of masks run, finer than pixels. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "fronto_kernels.h"

/* Pixels that are compared at once. */
enum { WORD = sizeof(uint64_t) };

/* Whether the pixels row[x] .. row[x + WORD - 1] are as those to their left and those above. */
static inline int no_edge(const uint8_t *row, const uint8_t *above, int64_t x) {
    uint64_t here, left, up;
    memcpy(&here, row + x, WORD), memcpy(&left, row + x - 1, WORD), memcpy(&up, above + x, WORD);
    return here == left && here == up;
}

/* How many edges there are between neighbours of which one is inside, above or to the left; what
 * lies beyond the array is outside. start: the first pixel inside, row by row. */
static int64_t count_edges(int64_t rows, int64_t columns, const uint8_t *inside, int64_t *start) {
    int64_t n = 0;
    *start = -1;
    for (int64_t y = 0; y < rows; y++) {
        const uint8_t *row = inside + y * columns, *above = y > 0 ? row - columns : 0;
        for (int64_t x = 0; x < columns; x++) {
            while (above && x > 0 && x + WORD <= columns && no_edge(row, above, x)) x += WORD;
            if (x == columns) break;
            if (row[x] && *start < 0) *start = y * columns + x;
            n += (row[x] != (x > 0 && row[x - 1])) + (row[x] != (above && above[x]));
        }
        n += row[columns - 1];
    }
    for (int64_t x = 0; rows && x < columns; x++) n += inside[(rows - 1) * columns + x];
    return n;
}

/* Whether pixels inside (0 or 1) are one piece without a hole, or none; pieces that touch at a
 * corner are one. The outline from the first of them on, with the inside to the right, is all edges
 * there are. */
FRONTO_API int fronto_is_whole(int64_t rows, int64_t columns, const uint8_t *inside) {
    int64_t start;
    const int64_t edges = count_edges(rows, columns, inside, &start);
    if (start < 0) return 1;
    const int64_t x0 = start % columns, y0 = start / columns;
    /* At the pixel's top-left corner, going right; steps right, down, left, up. */
    static const int dx[4] = {1, 0, -1, 0}, dy[4] = {0, 1, 0, -1};
    int64_t x = x0, y = y0, steps = 0;
    int way = 0;
    do {
        x += dx[way], y += dy[way], steps++;
        /* The pixels ahead of this corner, to the left and to the right. */
        const int64_t lx = x + (dx[way] + dy[way] - 1) / 2, ly = y + (dy[way] - dx[way] - 1) / 2;
        const int64_t rx = x + (dx[way] - dy[way] - 1) / 2, ry = y + (dy[way] + dx[way] - 1) / 2;
        const int left = lx >= 0 && ly >= 0 && lx < columns && ly < rows && inside[ly * columns + lx];
        const int right = rx >= 0 && ry >= 0 && rx < columns && ry < rows && inside[ry * columns + rx];
        way = left ? (way + 3) % 4 : right ? way : (way + 1) % 4;
    } while (x != x0 || y != y0 || way != 0);
    return steps == edges;
}

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
            while (row && above && x > 0 && x + WORD <= columns && no_edge(row, above, x)) x += WORD;
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
