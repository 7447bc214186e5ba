/* What robust fits share: iteratively reweighted least squares with Tukey's biweight. */
#ifndef FRONTO_ROBUST_H
#define FRONTO_ROBUST_H

#include <stdint.h>

/* Deviations of this many standard deviations count nothing; and how many rounds there are. */
#define TUKEY 4.685
enum { ROUNDS = 8 };
/* Deviations of points of masks' edges are taken to be no smaller than this, pixels. */
#define FLOOR_PX 0.1

/* The k-th smallest of n values, which it reorders (Hoare's quickselect). */
static inline double select_kth(double *v, int64_t n, int64_t k) {
    int64_t low = 0, high = n - 1;
    while (low < high) {
        const double pivot = v[k];
        int64_t i = low, j = high;
        do {
            while (v[i] < pivot) i++;
            while (pivot < v[j]) j--;
            if (i <= j) {
                const double t = v[i];
                v[i++] = v[j];
                v[j--] = t;
            }
        } while (i <= j);
        if (j < k) low = i;
        if (k < i) high = j;
    }
    return v[k];
}

/* Tukey's biweight; `reach` is 1 over the distance from which on it is 0. */
static inline double weight(double distance, double reach) {
    const double r = distance * reach, s = 1.0 - r * r;
    return s > 0 ? s * s : 0.0;
}

#endif
