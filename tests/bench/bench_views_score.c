#include "tests/bench/bench_views_data.h"

#include <math.h>
#include <stdlib.h>

static double decibels(double squares, double count)
{
    return count > 0 ? 10 * log10(65025 / fmax(squares / (3 * count), 1e-6)) : NAN;
}

void views_judge(const struct views_data *data, const struct views_image *p, const uint8_t *rgb, const uint8_t *alpha,
                 struct bench_measure *out)
{
    double both = 0, missing = 0, extra = 0, squares = 0, inside = 0;
    for (int i = 0; i < data->lens.width * data->lens.height; i++) {
        bool there = p->mask[i] != 0, drawn = alpha[i] >= 128;
        if (!there && !drawn)
            continue;
        double off = 0;
        for (int c = 0; c < 3; c++) {
            double d = (double)rgb[3 * i + c] - (double)p->expected[3 * i + c];
            off += d * d;
        }
        squares += off;
        inside += there && drawn ? off : 0;
        both += there && drawn;
        missing += there && !drawn;
        extra += drawn && !there;
    }
    double all = both + missing + extra;
    out->error = 100 * (missing + extra) / all;
    out->extra[0] = decibels(squares, all);
    out->extra[1] = decibels(inside, both);
    out->extra[2] = 100 * missing / all;
    out->extra[3] = 100 * extra / all;
}

int64_t views_nearest_frame(const struct take *take, int64_t since_ns)
{
    int64_t best = 0, at_ns = take_entry(take, 0)->time_ns + since_ns;
    for (int64_t i = 1; i < take_frame_count(take); i++)
        if (llabs(take_entry(take, i)->time_ns - at_ns) < llabs(take_entry(take, best)->time_ns - at_ns))
            best = i;
    return best;
}
