// Pace, pauses and pieces that one of two movements lacks, from timelines that are known: the attempt is made of the
// reference's own frames.
#include "tests/support/test.h"

#include "compare/pace.h"
#include "tests/support/exercise.h"

#include <stdlib.h>

static struct rng rng = {11};

enum { ALL_PARTS = (1 << PART_COUNT) - 1, MAX_FRAMES = 400 };

// Which of the reference's frames the attempt shows, one after the other.
struct order {
    int32_t at[MAX_FRAMES], count;
};

static void add_frames(struct order *order, int32_t first, int32_t end)
{
    for (int32_t f = first; f < end; f++)
        order->at[order->count++] = f;
}

static void hold_frame(struct order *order, int32_t frame, int32_t frames)
{
    for (int32_t k = 0; k < frames; k++)
        order->at[order->count++] = frame;
}

static struct pace measure(const struct order *order, double tempo)
{
    struct exercise e = exercise_default(), longer;
    struct joint_samples samples, more;
    struct movement a, b;
    struct pace pace;
    e.seconds = 9 / tempo;
    e.tempo = tempo;
    longer = e;
    longer.seconds = MAX_FRAMES / MOVEMENT_RATE_HZ + 1;
    exercise_samples(&e, &rng, &samples);
    exercise_samples(&longer, &rng, &more);
    EXPECT_STATUS(movement_from_samples(&samples, &a), OK);
    EXPECT_STATUS(movement_from_samples(&more, &b), OK);
    assert_true(order->count <= b.count);
    b.count = order->count; // whose frames are replaced
    struct timeline t = {malloc((size_t)order->count * sizeof *t.reference), order->count};
    assert_non_null(t.reference);
    for (int32_t f = 0; f < order->count; f++) {
        b.frames[f] = a.frames[order->at[f]];
        t.reference[f] = (float)order->at[f];
    }
    EXPECT_STATUS(pace_measure(&a, &b, ALL_PARTS, &t, false, &pace), OK);
    for (int32_t k = 0; k < pace.piece_count; k++)
        print_message("  %d: reference %d to %d, attempt %d to %d\n", (int)pace.pieces[k].kind, pace.pieces[k].a_first,
                      pace.pieces[k].a_end, pace.pieces[k].b_first, pace.pieces[k].b_end);
    timeline_free(&t);
    joint_samples_free(&samples);
    joint_samples_free(&more);
    movement_free(&a);
    movement_free(&b);
    return pace;
}

static void test_an_even_pace_has_no_pieces(void **state)
{
    (void)state;
    struct order same = {.count = 0};
    add_frames(&same, 0, 260);
    struct pace pace = measure(&same, 1);
    EXPECT_INT(pace.piece_count, 0);
    EXPECT_NEAR(pace.ratio, 1, 0.05);
    pace_free(&pace);
}

static void test_a_pause(void **state)
{
    (void)state;
    struct order order = {.count = 0};
    add_frames(&order, 0, 40);
    hold_frame(&order, 40, 30);
    add_frames(&order, 40, 260);
    struct pace pace = measure(&order, 1);
    EXPECT_INT(pace.piece_count, 1);
    EXPECT_INT(pace.pieces[0].kind, PIECE_PAUSE);
    EXPECT_NEAR(pace.pieces[0].b_first, 40, 3);
    EXPECT_NEAR(pace.pieces[0].b_end, 70, 3);
    EXPECT_INT(pace.extra + pace.missing, 0);
    EXPECT_NEAR(pace.ratio, 1, 0.05);
    pace_free(&pace);
}

// A repetition takes 90 frames: from its beginning to its middle everything is raised.
static void test_a_missing_piece(void **state)
{
    (void)state;
    struct order order = {.count = 0};
    add_frames(&order, 0, 100);
    add_frames(&order, 170, 260);
    struct pace pace = measure(&order, 1);
    EXPECT_INT(pace.piece_count, 1);
    EXPECT_INT(pace.pieces[0].kind, PIECE_MISSING);
    EXPECT_NEAR(pace.missing, 70, 6);
    pace_free(&pace);
}

// Where the alignment rests for a few frames on the way it is one piece; a second apart they are two. The arms are
// raised for three seconds, and lowered.
static void test_missing_pieces_near_each_other_are_one(void **state)
{
    (void)state;
    static const struct {
        int32_t next, wanted; // where the second begins
    } cases[] = {{45, 1}, {49, 1}, {190, 2}};
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        struct order order = {.count = 0};
        add_frames(&order, 0, 10);
        add_frames(&order, 45, cases[i].next);
        add_frames(&order, cases[i].next + 35, 360);
        print_message("%d frames between:\n", cases[i].next - 45);
        struct pace pace = measure(&order, 0.5);
        int32_t missing = 0;
        for (int32_t k = 0; k < pace.piece_count; k++)
            missing += pace.pieces[k].kind == PIECE_MISSING;
        EXPECT_INT(missing, cases[i].wanted);
        EXPECT_NEAR(pace.missing, cases[i].wanted == 1 ? cases[i].next + 35 - 10 : 70, 12);
        pace_free(&pace);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_an_even_pace_has_no_pieces),
        cmocka_unit_test(test_a_pause),
        cmocka_unit_test(test_a_missing_piece),
        cmocka_unit_test(test_missing_pieces_near_each_other_are_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
