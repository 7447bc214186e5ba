/* How fast a photo changes across curves.
 *
 * Curves have `count` stations each, at each of which the photo is sampled across the curve:
 * lines (n, count, across, channels). Their changes are told at m = across - taps + 1 places:
 * each line is smoothed with its neighbours (weights along, 2 aside + 1 of them) and convolved
 * with a derivative's kernel (taps). A curve that closes has no ends, and its step may have
 * another sign elsewhere; beyond the ends of others the last stations go on. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "fronto_kernels.h"

/* Samples on a station's line, and channels: the most there may be. */
enum { MOST_ACROSS = 96, MOST_CHANNELS = 4, MOST_LINE = MOST_ACROSS * MOST_CHANNELS };
/* Stations of a curve whose mean is taken: the most there may be. */
enum { MOST_COUNT = 16 };

/* A photo: rows of pixels of some channels. */
typedef struct {
    const uint8_t *pixels;
    int64_t height, width, channels;
} Photo;

/* The photo at x, y: linear between pixels, its edge pixels go on beyond the border. `channels`
 * is the photo's; compilers unroll it where it is a constant. */
static inline void sample(const Photo *photo, int channels, double x, double y, float *out) {
    const double right = (double)(photo->width - 1), bottom = (double)(photo->height - 1);
    x = x > 0 ? (x < right ? x : right) : 0.0;
    y = y > 0 ? (y < bottom ? y : bottom) : 0.0;
    const int64_t c = (int64_t)x, r = (int64_t)y;
    const float u = (float)(x - (double)c), v = (float)(y - (double)r);
    const uint8_t *p = photo->pixels + (r * photo->width + c) * channels;
    const int64_t next = c + 1 < photo->width ? channels : 0;
    const uint8_t *q = r + 1 < photo->height ? p + photo->width * channels : p;
    for (int k = 0; k < channels; k++) {
        const float above = (float)p[k] + u * ((float)p[next + k] - (float)p[k]);
        const float below = (float)q[k] + u * ((float)q[next + k] - (float)q[k]);
        out[k] = above + v * (below - above);
    }
}

/* Bits of fixed-point coordinates behind the point, and those of them that weights have. */
enum { POINT = 32, WEIGHT = 24 };

/* Between four pixels the photo is base + u right + v (down + u both); lanes are channels, and
 * so many that compilers compute them at once. */
typedef struct {
    float base[MOST_CHANNELS], right[MOST_CHANNELS], down[MOST_CHANNELS], both[MOST_CHANNELS];
} Cell;

static inline void load_cell(Cell *cell, int channels, const uint8_t *p, const uint8_t *q) {
    for (int k = 0; k < channels; k++) {
        const float right = (float)p[channels + k] - (float)p[k];
        cell->base[k] = (float)p[k], cell->right[k] = right;
        cell->down[k] = (float)q[k] - (float)p[k];
        cell->both[k] = (float)q[channels + k] - (float)q[k] - right;
    }
}

/* Places from, from + step, ...: n of them. */
static inline void sample_line(const Photo *photo, int channels, const double *from,
                               const double *step, int64_t n, float *out) {
    const double to[2] = {from[0] + (double)(n - 1) * step[0], from[1] + (double)(n - 1) * step[1]};
    const double right = (double)(photo->width - 1), bottom = (double)(photo->height - 1);
    if (!(channels <= MOST_CHANNELS && fmin(from[0], to[0]) > 0 && fmax(from[0], to[0]) < right && fmin(from[1], to[1]) > 0 &&
          fmax(from[1], to[1]) < bottom)) {
        for (int64_t s = 0; s < n; s++)
            sample(photo, channels, from[0] + (double)s * step[0], from[1] + (double)s * step[1],
                   out + s * channels);
        return;
    }
    /* All of it lies in the photo: whole numbers are faster, and neighbours share a cell. */
    const double unit = (double)((int64_t)1 << POINT);
    const int64_t dx = (int64_t)(step[0] * unit), dy = (int64_t)(step[1] * unit);
    const float scale = 1.0f / (float)(1 << WEIGHT);
    int64_t x = (int64_t)(from[0] * unit), y = (int64_t)(from[1] * unit), before = -1;
    Cell cell = {{0}, {0}, {0}, {0}};
    for (int64_t s = 0; s < n; s++, x += dx, y += dy) {
        const int64_t at = (y >> POINT) * photo->width + (x >> POINT);
        const float u = scale * (float)(int32_t)((uint32_t)x >> (POINT - WEIGHT));
        const float v = scale * (float)(int32_t)((uint32_t)y >> (POINT - WEIGHT));
        float value[MOST_CHANNELS];
        if (at != before) {
            const uint8_t *p = photo->pixels + at * channels;
            load_cell(&cell, channels, p, p + photo->width * channels);
            before = at;
        }
        for (int k = 0; k < MOST_CHANNELS; k++)
            value[k] = cell.base[k] + u * cell.right[k] + v * (cell.down[k] + u * cell.both[k]);
        for (int k = 0; k < channels; k++) out[s * channels + k] = value[k];
    }
}

/* places (n, 2) -> out (n, channels) */
FRONTO_API void fronto_sample(const uint8_t *image, int64_t height, int64_t width, int64_t channels,
                              int64_t n, const double *places, float *out) {
    const Photo photo = {image, height, width, channels};
    for (int64_t i = 0; i < n; i++)
        sample(&photo, (int)channels, places[2 * i], places[2 * i + 1], out + i * channels);
}

/* Where samples lie closer together, pixels, every other one is the mean of its neighbours. */
static const double FINE = 0.3;

/* Lines of `across` samples through `count` stations p along normals d, the first one `before` a
 * station. */
static void sample_curve(const Photo *photo, int64_t count, const double *p, const double *d,
                         double before, double step, int64_t across, float *lines) {
    for (int64_t j = 0; j < count; j++, p += 2, d += 2) {
        const double from[2] = {p[0] - before * d[0], p[1] - before * d[1]};
        const double by[2] = {step * d[0], step * d[1]};
        float *line = lines + j * across * photo->channels;
        if (photo->channels == 3)
            sample_line(photo, 3, from, by, across, line);
        else
            sample_line(photo, (int)photo->channels, from, by, across, line);
    }
}

/* xy, normal (n, count, 2): stations and unit normals; reach (n): of the samples on either side,
 * but for `extra` of them at either end, which lie beyond. -> lines */
FRONTO_API void fronto_lines(const uint8_t *image, int64_t height, int64_t width, int64_t channels,
                             int64_t n, int64_t count, const double *xy, const double *normal,
                             const double *reach, int64_t across, int64_t extra, float *lines) {
    const Photo photo = {image, height, width, channels};
    const double half = (double)(across - 1) / 2;
    for (int64_t i = 0; i < n; i++) {
        const double step = reach[i] / (half - (double)extra);
        sample_curve(&photo, count, xy + 2 * i * count, normal + 2 * i * count, half * step, step,
                     across, lines + i * count * across * channels);
    }
}

/* The mean of each curve's lines, and how far they differ from it: as fronto_lines without `extra`,
 * count up to MOST_COUNT -> profiles (n, across, channels + 1) */
FRONTO_API void fronto_profiles(const uint8_t *image, int64_t height, int64_t width,
                                int64_t channels, int64_t n, int64_t count, const double *xy,
                                const double *normal, const double *reach, int64_t across,
                                float *profiles) {
    float lines[MOST_COUNT * MOST_LINE], means[MOST_LINE], differences[MOST_LINE];
    const Photo photo = {image, height, width, channels};
    const float share = 1.0f / (float)count;
    for (int64_t i = 0; i < n; i++) {
        const double step = 2 * reach[i] / (double)(across - 1);
        const int64_t every = step < FINE ? 2 : 1, seen = every == 2 ? across / 2 + 1 : across;
        const int64_t values = seen * channels;
        sample_curve(&photo, count, xy + 2 * i * count, normal + 2 * i * count, reach[i],
                     (double)every * step, seen, lines);
        for (int64_t v = 0; v < values; v++) means[v] = differences[v] = 0;
        for (int64_t j = 0; j < count; j++)
            for (int64_t v = 0; v < values; v++) means[v] += share * lines[j * values + v];
        for (int64_t j = 0; j < count; j++)
            for (int64_t v = 0; v < values; v++)
                differences[v] += fabsf(lines[j * values + v] - means[v]);
        for (int64_t s = 0; s < across; s++) {
            const int64_t low = s / every * channels, high = (s + every - 1) / every * channels;
            float *told = profiles + (i * across + s) * (channels + 1), sum = 0;
            for (int64_t k = 0; k < channels; k++) {
                told[k] = (means[low + k] + means[high + k]) / 2;
                sum += differences[low + k] + differences[high + k];
            }
            told[channels] = share * sum / (float)(2 * channels);
        }
    }
}

/* Index of a station `away` from station j. */
static int64_t neighbour(int64_t j, int64_t away, int64_t count, int closes) {
    const int64_t at = j + away;
    if (closes) return ((at % count) + count) % count;
    return at < 0 ? 0 : at >= count ? count - 1 : at;
}

/* What each station counts in the mean of all smoothed ones, where the curve has ends. */
static float share_of(int64_t j, int64_t count, int64_t aside, const float *along) {
    float share = 0;
    for (int64_t a = -aside; a <= aside; a++) {
        if (j == 0)
            for (int64_t k = 0; k + a <= 0 && k < count; k++) share += along[a + aside];
        else if (j == count - 1)
            for (int64_t k = count - 1; k + a >= count - 1 && k >= 0; k--) share += along[a + aside];
        else if (j - a >= 0 && j - a < count)
            share += along[a + aside];
    }
    return share / (float)count;
}

/* Mean (span, channels) of a curve's smoothed lines, from their sample `low` on. */
static void mean_line(int64_t count, int64_t across, int64_t channels, const float *curve,
                      int64_t aside, const float *along, int64_t low, int64_t span, float *mean) {
    for (int64_t s = 0; s < span * channels; s++) mean[s] = 0;
    for (int64_t j = 0; j < count; j++) {
        const float *line = curve + (j * across + low) * channels;
        const float share = share_of(j, count, aside, along);
        for (int64_t s = 0; s < span * channels; s++) mean[s] += share * line[s];
    }
}

/* Changes (m, channels) along one line of samples. */
static void derive(int64_t m, int64_t channels, const float *line, int64_t taps,
                   const float *kernel, float *change) {
    for (int64_t i = 0; i < m * channels; i++) change[i] = 0;
    for (int64_t t = 0; t < taps; t++) {
        const float *from = line + t * channels, weight = kernel[t];
        for (int64_t i = 0; i < m * channels; i++) change[i] += weight * from[i];
    }
}

/* How strong the change is at each place across each curve, in all channels: of the stations'
 * mean; where curves close, the mean of the stations' strengths. -> strength (n, m). Returns 0 if
 * there are too many samples. */
FRONTO_API int fronto_strengths(int64_t n, int64_t count, int64_t across, int64_t channels,
                                const float *lines, int64_t taps, const float *kernel,
                                int64_t aside, const float *along, int closes, double *strength) {
    const int64_t wide = across * channels, m = across - taps + 1;
    float line[MOST_LINE], change[MOST_LINE];
    if (across > MOST_ACROSS || channels > MOST_CHANNELS || m < 3) return 0;
    for (int64_t i = 0; i < n; i++) {
        const float *curve = lines + i * count * wide;
        double *out = strength + i * m;
        for (int64_t s = 0; s < m; s++) out[s] = 0;
        for (int64_t j = 0; j < (closes ? count : 1); j++) {
            if (closes) {
                for (int64_t s = 0; s < wide; s++) line[s] = 0;
                for (int64_t k = -aside; k <= aside; k++) {
                    const float *other = curve + neighbour(j, k, count, 1) * wide;
                    const float weight = along[k + aside];
                    for (int64_t s = 0; s < wide; s++) line[s] += weight * other[s];
                }
            } else
                mean_line(count, across, channels, curve, aside, along, 0, across, line);
            derive(m, channels, line, taps, kernel, change);
            for (int64_t s = 0; s < m; s++) {
                float sum = 0;
                for (int64_t k = 0; k < channels; k++)
                    sum += change[s * channels + k] * change[s * channels + k];
                out[s] += sqrt((double)sum) / (double)(closes ? count : 1);
            }
        }
    }
    return 1;
}

/* The edge of each curve, of strengths (n, m) at m places from -1 to 1: the strongest of those
 * near the place `common`, whose deviation there is sd (n); then uphill to the edge itself, at most
 * `walk` places: the wish for the common place moves its flank.
 * -> peak (n): its place, 0 to m - 1; found, median (n): the strength there and of all places.
 * Returns 0 if there are too many places. */
FRONTO_API int fronto_peaks(int64_t n, int64_t m, const double *strength, double common,
                            const double *sd, int64_t walk, int64_t *peak, double *found,
                            double *median) {
    double sorted[MOST_ACROSS];
    if (m > MOST_ACROSS || m < 3) return 0;
    for (int64_t i = 0; i < n; i++) {
        const double *s = strength + i * m;
        double most = -1;
        int64_t at = 0;
        for (int64_t j = 0; j < m; j++) {
            const double away = (2.0 * (double)j / (double)(m - 1) - 1 - common) / sd[i];
            const double wanted = s[j] * exp(-0.5 * away * away);
            if (wanted > most) most = wanted, at = j;
            int64_t k = j;
            for (; k > 0 && sorted[k - 1] > s[j]; k--) sorted[k] = sorted[k - 1];
            sorted[k] = s[j];
        }
        for (int64_t k = 0; k < walk; k++) {
            const int64_t left = at > 0 ? at - 1 : 0, right = at < m - 1 ? at + 1 : m - 1;
            /* The first of the highest. */
            if (s[left] >= s[at] && s[left] >= s[right])
                at = left;
            else if (s[right] > s[at])
                at = right;
        }
        peak[i] = at, found[i] = s[at];
        median[i] = m % 2 ? sorted[m / 2] : (sorted[m / 2 - 1] + sorted[m / 2]) / 2;
    }
    return 1;
}

/* Step of each station at the places low to high (of one curve), as heights (count, high - low +
 * 1): along the curve's own step in colour at place peak; where it closes, of any colour. */
static void heights_of(int64_t count, int64_t across, int64_t channels, const float *curve,
                       int64_t taps, const float *kernel, int64_t aside, const float *along,
                       int closes, int64_t peak, int64_t low, int64_t high, float *work,
                       double *height) {
    const int64_t wide = across * channels, span = high - low + taps, m = high - low + 1;
    const int64_t kept = closes ? channels : 1;
    float direction[MOST_CHANNELS] = {0}, line[MOST_LINE];
    if (!closes) {
        double length = 0;
        mean_line(count, across, channels, curve, aside, along, peak, taps, line);
        derive(1, channels, line, taps, kernel, direction);
        for (int64_t k = 0; k < channels; k++) length += (double)direction[k] * direction[k];
        const float scale = (float)(1 / fmax(sqrt(length), 1e-6));
        for (int64_t k = 0; k < channels; k++) direction[k] *= scale;
    }
    /* What is needed of each line: in one channel, if the step has one colour. */
    float *part = work;
    for (int64_t j = 0; j < count; j++) {
        const float *at = curve + j * wide + low * channels;
        float *to = part + j * span * kept;
        for (int64_t s = 0; s < span * channels && closes; s++) to[s] = at[s];
        for (int64_t s = 0; s < span && !closes; s++) {
            float sum = 0;
            for (int64_t k = 0; k < channels; k++) sum += at[s * channels + k] * direction[k];
            to[s] = sum;
        }
    }
    for (int64_t j = 0; j < count; j++) {
        float smooth[MOST_LINE], change[MOST_LINE];
        for (int64_t s = 0; s < span * kept; s++) smooth[s] = 0;
        for (int64_t a = -aside; a <= aside; a++) {
            const float *other = part + neighbour(j, a, count, closes) * span * kept;
            const float weight = along[a + aside];
            for (int64_t s = 0; s < span * kept; s++) smooth[s] += weight * other[s];
        }
        derive(m, kept, smooth, taps, kernel, change);
        for (int64_t s = 0; s < m; s++) {
            double sum = 0;
            for (int64_t k = 0; k < kept; k++) sum += (double)change[s * kept + k] * change[s * kept + k];
            height[j * m + s] = closes ? sqrt(sum) : (double)change[s];
        }
    }
}

/* Where each station shows the edge that its curve has at place peak (n), where it is as strong
 * as found (n). Stations look `near` places around; what is weaker than `least` of the curve's is
 * none. -> place (n, count), from 0 to m - 1, NaN for none; mean, deviation (n): of the stations'
 * steps at the peak. Returns 0 if memory ran out. */
FRONTO_API int fronto_station_edges(int64_t n, int64_t count, int64_t across, int64_t channels,
                                    const float *lines, int64_t taps, const float *kernel,
                                    int64_t aside, const float *along, int closes,
                                    const int64_t *peak, const double *found, int64_t near,
                                    double least, double *place, double *mean, double *deviation) {
    const int64_t last = across - taps;
    float *work = malloc((size_t)(count * across * channels) * sizeof *work);
    double *height = malloc((size_t)(count * across) * sizeof *height);
    for (int64_t i = 0; i < n && work && height; i++) {
        const int64_t low = peak[i] - near > 0 ? peak[i] - near : 0;
        const int64_t high = peak[i] + near < last ? peak[i] + near : last;
        const int64_t from = low > 0 ? low - 1 : 0, to = high < last ? high + 1 : last;
        double sum = 0, squares = 0;
        heights_of(count, across, channels, lines + i * count * across * channels, taps, kernel,
                   aside, along, closes, peak[i], from, to, work, height);
        for (int64_t j = 0; j < count; j++) {
            const double *h = height + j * (to - from + 1) - from;
            sum += h[peak[i]], squares += h[peak[i]] * h[peak[i]];
            int64_t at = low;
            for (int64_t s = low + 1; s <= high; s++)
                if (h[s] > h[at]) at = s;
            at = at < 1 ? 1 : at > last - 1 ? last - 1 : at;
            const double bend = h[at - 1] - 2 * h[at] + h[at + 1];
            const double shift = 0.5 * (h[at - 1] - h[at + 1]) / bend;
            const int good = bend < 0 && fabs(shift) <= 1 && h[at] >= least * found[i];
            place[i * count + j] = good ? (double)at + shift : NAN;
        }
        mean[i] = sum / (double)count;
        deviation[i] = sqrt(fmax(squares / (double)count - mean[i] * mean[i], 0.0));
    }
    const int done = work && height;
    free(work);
    free(height);
    return done;
}
