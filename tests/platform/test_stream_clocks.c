// Colour and depth of one sensor by different clocks are named with the offset or rate; streams of one clock are not
// blamed, whatever their rates, gaps, late starts and early ends.
#include "tests/support/test.h"

#include "platform/sensors/stream_clocks.h"
#include "tests/support/random.h"

#include <stdio.h>

// A stream as it is filmed: from when to when by the true time, then written by a clock of its own.
struct stream {
    double from_s, to_s, rate_hz;
    double ahead_s, rate;  // of its clock
    double jitter_s, lost; // share of the images
};

static struct stream_times times_of(const struct stream *s, uint64_t seed)
{
    struct rng rng = {seed};
    struct stream_times t = {0};
    for (int i = 0; s->from_s + i / s->rate_hz < s->to_s; i++) {
        const double at = s->from_s + i / s->rate_hz + s->jitter_s * (2 * rng_uniform(&rng) - 1);
        if (rng_uniform(&rng) >= s->lost)
            stream_times_add(&t, (int64_t)llround(1e9 * (at * s->rate + s->ahead_s)));
    }
    return t;
}

static const struct pair {
    const char *what;
    struct stream color, depth;
    int64_t pairs;
    enum clock_fault fault;
    double value; // seconds ahead, or the rate
} pairs[] = {
    {"one clock", {0, 60, 30, 0, 1, 0.001, 0}, {0, 60, 30, 0, 1, 0.001, 0}, 1800, CLOCKS_AGREE, 0},
    {"29.97 and 30 Hz of one clock", {0, 300, 29.97, 0, 1, 0, 0}, {0, 300, 30, 0, 1, 0, 0}, 9000, CLOCKS_AGREE, 0},
    {"15 and 30 Hz", {0, 20, 15, 0, 1, 0.002, 0.1}, {0, 20, 30, 0, 1, 0.002, 0.05}, 280, CLOCKS_AGREE, 0},
    {"colour starts late", {3, 20, 30, 0, 1, 0.001, 0}, {0, 20, 30, 0, 1, 0.001, 0}, 500, CLOCKS_AGREE, 0},
    {"colour ends early", {0, 10, 30, 0, 1, 0.001, 0}, {0, 20, 30, 0, 1, 0.001, 0}, 300, CLOCKS_AGREE, 0},
    {"both", {2, 15, 30, 0, 1, 0.001, 0}, {0, 20, 30, 0, 1, 0.001, 0}, 390, CLOCKS_AGREE, 0},
    {"webcam in the dark", {0.1, 60, 7.5, 0, 1, 0.01, 0.2}, {0, 60, 30, 0, 1, 0.001, 0}, 360, CLOCKS_AGREE, 0},
    {"a few frames late", {0.15, 30.15, 30, 0, 1, 0.001, 0}, {0, 30, 30, 0, 1, 0.001, 0}, 890, CLOCKS_AGREE, 0},
    {"very short", {0, 0.2, 30, 0, 1, 0, 0}, {0, 0.2, 30, 0, 1, 0, 0}, 6, CLOCKS_AGREE, 0},
    {"3.2 s ahead", {0, 20, 30, 3.2, 1, 0.001, 0.05}, {0, 20, 30, 0, 1, 0.001, 0}, 500, CLOCKS_SHIFTED, 3.2},
    {"an hour behind", {0, 20, 15, -3600, 1, 0.001, 0}, {0, 20, 30, 0, 1, 0.001, 0}, 0, CLOCKS_SHIFTED, -3600},
    {"since 1970 and since boot", {0, 5, 30, 1.7e9, 1, 0, 0}, {0, 5, 30, 88, 1, 0, 0}, 0, CLOCKS_SHIFTED, 1.7e9 - 88},
    {"1.001", {0, 300, 30, 0, 1.001, 0.001, 0.02}, {0, 300, 30, 0, 1, 0.001, 0.02}, 8000, CLOCKS_RATE, 1.001},
    {"400 ppm slow", {0, 600, 30, 0, 0.9996, 0.001, 0}, {0, 600, 30, 0, 1, 0.001, 0}, 17000, CLOCKS_RATE, 0.9996},
    {"counted at 15 Hz", {0, 20, 30, 0, 2, 0, 0}, {0, 20, 30, 0, 1, 0, 0}, 300, CLOCKS_RATE, 2},
    {"ms and s", {0, 10, 30, 0, 1e3, 0.001, 0}, {0, 10, 30, 0, 1, 0.001, 0}, 0, CLOCKS_RATE, 1e3},
    {"ms and microseconds", {0, 10, 30, 0, 1e3, 0, 0.1}, {0, 10, 30, 0, 1e6, 0, 0}, 0, CLOCKS_RATE, 1e-3},
    {"two films", {0, 3, 30, 500, 1, 0, 0}, {0, 60, 30, 0, 1, 0, 0}, 0, CLOCKS_APART, 500},
};

static void test_clocks_are_told(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT_OF(pairs); i++)
        for (uint64_t seed = 1; seed <= 5; seed++) {
            const struct pair *p = &pairs[i];
            char text[STREAM_CLOCKS_TEXT_BYTES];
            const struct stream_times color = times_of(&p->color, seed), depth = times_of(&p->depth, seed + 100);
            const struct clock_finding f = stream_clocks_judge(&color, &depth, p->pairs);
            const double found = f.fault == CLOCKS_RATE ? f.rate : f.ahead_s;
            printf("%-28s fault %d, %.6f: %s\n", p->what, (int)f.fault, found, stream_clocks_text(&f, seed % 2, text));
            EXPECT_INT(f.fault, p->fault);
            EXPECT_TRUE((p->fault == CLOCKS_AGREE) == !*text);
            if (p->fault == CLOCKS_SHIFTED || p->fault == CLOCKS_APART)
                EXPECT_NEAR(found, p->value, 0.2); // images at the ends may be lost
            else if (p->fault == CLOCKS_RATE)
                EXPECT_NEAR(found / p->value, 1, fabs(p->value - 1) > 0.01 ? 0.02 : 0.15 * fabs(p->value - 1));
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_clocks_are_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
