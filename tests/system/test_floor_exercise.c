// An exercise on the floor through all of it: recorded from the side, judged, drawn from all round, compared with the
// same by another person and with another; and the same towards the sensor, where the trunk is hidden behind head and
// shoulders.
#include "tests/support/test.h"

#include "tests/support/answer.h"
#include "tests/support/drawn_film.h"
#include "tests/support/film.h"

#include <stdio.h>
#include <string.h>

#define CAPTURE PROGRAM_DIR "/reenact-capture"
#define REENACT PROGRAM_DIR "/reenact"

enum { FRAMES = 33 };
static const double SCALE = 0.5, RATE_HZ = 22, DEGREE = 0.017453292519943295;

static struct scratch scratch;
static char file[512];

static const struct film_case {
    const char *take, *figure, *motion;
    double degrees; // of the heading, against the sensor's
} films[] = {
    {"push-up", "woman", "push-up:7", 65},
    {"the same", "man", "push-up:7", 65},
    {"lying", "man", "lying-on-back:3", 65},
    {"hidden", "woman", "push-up:7", 0},
};

static struct world *world_of(const struct film_case *film)
{
    struct world *world;
    struct world_options o = world_default_options();
    o.motion = film->motion;
    o.plain = true;
    o.spot.turned = film->degrees * DEGREE;
    EXPECT_TRUE(world_figure_named(film->figure, &o.figure));
    EXPECT_STATUS(world_open(&world, &o), OK);
    return world;
}

static struct process_result record(const struct film_case *film)
{
    char uri[600];
    struct world *world = world_of(film);
    film_sensor_at(world, &scratch, film->take, SCALE, RATE_HZ, FRAMES);
    world_close(&world);
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, film->take));
    return PROCESS(CAPTURE, "record", "--no-body-points", "--sensor", uri, film == films ? "--out" : "--into", file,
                   "--take", film->take, "--for", "compare");
}

static void test_take_is_good(void **state)
{
    (void)state;
    const struct process_result said = record(&films[0]);
    print_message("%s", said.out);
    EXPECT_ANSWER(said, "a person in 33,");
    EXPECT_TRUE(!strstr(said.out, "no person"));
}

static void test_picture_is_right(void **state)
{
    (void)state;
    struct gpu *gpu;
    struct world *world = world_of(&films[0]);
    EXPECT_STATUS(gpu_open(&gpu), OK);
    const struct drawn_score score =
        draw_film(world, file, &(struct drawn_film){films[0].take, FRAMES / RATE_HZ, RATE_HZ}, gpu);
    gpu_close(&gpu);
    world_close(&world);
    print_message("outline %.3f, %.1f dB\n", score.outline, score.psnr_db);
    EXPECT_AT_LEAST(score.outline, 0.75); // measured 0.825
}

static void test_compared(void **state)
{
    (void)state;
    for (int i = 1; i < 3; i++)
        EXPECT_INT(record(&films[i]).exit_code, 0);
    const struct process_result same = PROCESS(REENACT, "compare", file, "--take", films[0].take, "--with", file,
                                               "--with-take", films[1].take),
                                other = PROCESS(REENACT, "compare", file, "--take", films[0].take, "--with", file,
                                                "--with-take", films[2].take);
    print_message("%s%s", same.out, other.out);
    EXPECT_ANSWER(other, "no score");
    int score = 0;
    EXPECT_INT(sscanf(same.out, "score %d of 100", &score), 1);
    EXPECT_AT_LEAST(score, 75); // measured 89, sigma 8
}

static void test_hidden_trunk_is_named(void **state)
{
    (void)state;
    const struct process_result said = record(&films[3]);
    print_message("%s", said.out);
    EXPECT_ANSWER(said, "was guessed in");
    EXPECT_TRUE(!strstr(said.out, "no person"));
}

int main(void)
{
    scratch = scratch_make();
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "floor.reenact"));
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_take_is_good), cmocka_unit_test(test_picture_is_right),
                                       cmocka_unit_test(test_compared), cmocka_unit_test(test_hidden_trunk_is_named)};
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    scratch_remove(&scratch);
    return failed;
}
