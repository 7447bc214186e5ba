/* Texts that steps of connectionist temporal classification may mean, and their probabilities.
 *
 * A text is a number to the base `classes`; its digits are the classes of its characters, the
 * last digit the last character. `fronto.labels.decode` says what is searched for, and why. */
#include <stdint.h>
#include <string.h>

#include "fronto_kernels.h"

#define MOST_WIDTH 128
#define MOST_TRIED 8
#define MOST_CHARACTERS 64

typedef struct {
    uint64_t code;
    double closed, open; /* the paths that end in a blank, and those in the last character */
} text;

/* The likeliest characters of a step, at most `tried`; how many there are. */
static int likely(const double *step, int classes, int tried, int *found) {
    int count = 0;
    for (int c = 1; c < classes; c++) {
        int place = count;
        while (place > 0 && step[found[place - 1]] < step[c]) {
            place--;
        }
        if (place < tried) {
            const int last = count < tried ? count : tried - 1;
            for (int k = last; k > place; k--) {
                found[k] = found[k - 1];
            }
            found[place] = c;
            count = last + 1;
        }
    }
    return count;
}

/* Keep the likelier ones: `best` holds `count` texts in falling order, at most `width`. */
static int keep(text *best, int count, int width, text one) {
    const double worth = one.closed + one.open;
    if (worth <= 0) {
        return count;
    }
    int place = count;
    while (place > 0 && best[place - 1].closed + best[place - 1].open < worth) {
        place--;
    }
    if (place >= width) {
        return count;
    }
    const int last = count < width ? count : width - 1;
    memmove(best + place + 1, best + place, (size_t)(last - place) * sizeof(text));
    best[place] = one;
    return last + 1;
}

/* The probability of a text over all paths: the forward variables of Graves et al. (2006). */
static double exact(const double *steps, int count, int classes, uint64_t code) {
    int digits[MOST_CHARACTERS], length = 0;
    for (uint64_t rest = code; rest; rest /= (uint64_t)classes) {
        digits[length++] = (int)(rest % (uint64_t)classes);
    }
    /* States: the characters, first to last, with blanks around them. */
    double forward[2 * MOST_CHARACTERS + 1] = {0};
    const int states = 2 * length + 1;
    for (int t = 0; t < count; t++) {
        const double *step = steps + (long)t * classes;
        for (int s = states - 1; s >= 0; s--) {
            const int digit = s % 2 ? digits[length - 1 - s / 2] : 0;
            double came = forward[s];
            if (t == 0) {
                came = s < 2 ? 1 : 0;
            } else {
                if (s > 0) {
                    came += forward[s - 1];
                }
                if (s > 2 && digit && digit != digits[length - s / 2]) {
                    came += forward[s - 2];
                }
            }
            forward[s] = came * step[digit];
        }
    }
    return forward[states - 1] + (length ? forward[states - 2] : 0);
}

/* One sequence of steps (count, classes) to `width` texts, of which the unlikely may be unused. */
static void search(const double *steps, int count, int classes, int width, int tried, uint64_t full,
                   uint64_t *codes, double *found) {
    text texts[MOST_WIDTH] = {{0, 1, 0}}, best[MOST_WIDTH];
    int characters[MOST_TRIED], kept = 1;
    for (int t = 0; t < count; t++) {
        const double *step = steps + (long)t * classes;
        const int some = likely(step, classes, tried, characters);
        int next = 0;
        for (int i = 0; i < kept; i++) {
            const uint64_t code = texts[i].code;
            const int last = (int)(code % (uint64_t)classes);
            const double total = texts[i].closed + texts[i].open;
            /* The same text again: a blank, or its last character once more ... */
            text same = {code, total * step[0], last ? texts[i].open * step[last] : 0};
            /* ... or a shorter one that is kept, too, and becomes this one. A character stands
             * twice in a text only where a blank comes in between. */
            for (int j = 0; last && j < kept; j++) {
                if (texts[j].code == code / (uint64_t)classes) {
                    const int twice = (int)(texts[j].code % (uint64_t)classes) == last;
                    same.open +=
                        (texts[j].closed + (twice ? 0 : texts[j].open)) * step[last];
                }
            }
            next = keep(best, next, width, same);
            /* A new text: one with one more character. */
            for (int k = 0; code < full && k < some; k++) {
                const int c = characters[k];
                const uint64_t longer = code * (uint64_t)classes + (uint64_t)c;
                int known = 0;
                for (int j = 0; j < kept; j++) {
                    known |= texts[j].code == longer;
                }
                if (!known) {
                    text grown = {longer, 0, (last == c ? texts[i].closed : total) * step[c]};
                    next = keep(best, next, width, grown);
                }
            }
        }
        memcpy(texts, best, (size_t)next * sizeof(text));
        kept = next;
    }
    for (int i = 0; i < width; i++) {
        codes[i] = i < kept ? texts[i].code : 0;
        found[i] = i < kept ? exact(steps, count, classes, codes[i]) : 0;
    }
}

/* steps (n, count, classes), each of sum 1; `full` as of `fronto.labels.decode`; out: codes and
 * found (n, width). Width and tried up to 128 and 8. */
FRONTO_API void fronto_ctc_search(int n, int count, int classes, const double *steps, int width,
                                  int tried, uint64_t full, uint64_t *codes, double *found) {
    for (int k = 0; k < n; k++) {
        search(steps + (long)k * count * classes, count, classes, width, tried, full,
               codes + (long)k * width, found + (long)k * width);
    }
}
