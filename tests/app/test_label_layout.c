// Labels never cover each other or a control, keep their side, and the arrow points the way to turn.
#include "tests/support/test.h"

#include "app/state/view_state.h"
#include "app/ui/room_page.h"
#include "tests/support/random.h"

#include <math.h>

enum { SEED = 5, LABELS = 24 };

static bool overlap(struct ui_box a, struct ui_box b)
{
    return a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;
}

static const struct ui_box bounds = {0, 0, 1280, 800};
static const struct ui_box taken[2] = {{280, 630, 720, 150}, {16, 16, 1248, 58}};

static int check(const struct placed_label *l, int count)
{
    int placed = 0;
    for (int i = 0; i < count; i++) {
        if (l[i].side == LABEL_NO_SIDE)
            continue;
        placed++;
        const struct ui_box b = l[i].box;
        EXPECT_TRUE(b.x >= 0 && b.y >= 0 && b.x + b.w <= bounds.w && b.y + b.h <= bounds.h);
        EXPECT_TRUE(!overlap(b, taken[0]) && !overlap(b, taken[1]));
        for (int k = 0; k < i; k++)
            EXPECT_TRUE(l[k].side == LABEL_NO_SIDE || !overlap(b, l[k].box));
    }
    return placed;
}

static void test_no_label_covers_another(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    print_message("seed %d\n", SEED);
    int all = 0, inside = 0;
    for (int n = 0; n < 200; n++) {
        struct placed_label l[LABELS];
        const double spread = n % 2 ? 1 : 0.2; // also crowded ones
        for (int i = 0; i < LABELS; i++) {
            l[i] = (struct placed_label){.at = {rng_between(&rng, 640 - 640 * spread, 640 + 640 * spread),
                                                rng_between(&rng, 350 - 300 * spread, 350 + 300 * spread)},
                                         .w = rng_between(&rng, 60, 200),
                                         .h = 58,
                                         .side = LABEL_NO_SIDE};
        }
        label_layout(l, LABELS, bounds, taken, 2);
        all += check(l, LABELS);
        inside += LABELS;
        EXPECT_TRUE(l[0].side != LABEL_NO_SIDE); // the first chooses first
    }
    print_message("%d of %d labels have a place\n", all, inside);
    EXPECT_AT_LEAST(all, 0.8 * inside);
}

static void test_a_label_keeps_its_side(void **state)
{
    (void)state;
    struct placed_label l[2] = {{.at = {400, 300}, .w = 100, .h = 58, .side = LABEL_NO_SIDE},
                                {.at = {405, 302}, .w = 100, .h = 58, .side = LABEL_NO_SIDE}};
    label_layout(l, 2, bounds, taken, 2);
    const int first = l[0].side, second = l[1].side;
    EXPECT_TRUE(first != second && second != LABEL_NO_SIDE);
    for (int i = 0; i < 50; i++) { // the second moves away: above is free again, but it stays where it was
        l[1].at.x += 4;
        label_layout(l, 2, bounds, taken, 2);
        EXPECT_INT(l[0].side, first);
        EXPECT_INT(l[1].side, second);
    }
    l[1].at = (struct ui_point){-5, 300}; // out of sight
    label_layout(l, 2, bounds, taken, 2);
    EXPECT_INT(l[1].side, LABEL_NO_SIDE);
}

static void test_the_arrow_points_the_way(void **state)
{
    (void)state;
    const struct ui_point axis = {640, 400};
    const struct ui_box in = {34, 34, 1212, 732};
    struct edge_arrow a = edge_arrow_of(axis, 100, 50, true, in);
    EXPECT_TRUE(a.inside && a.dy > 0.99);
    EXPECT_NEAR(a.at.x, 740, 1e-9);
    a = edge_arrow_of(axis, 2000, 0, true, in); // far to the right
    EXPECT_TRUE(!a.inside && a.dx > 0.99);
    EXPECT_NEAR(a.at.x, 34 + 1212, 1e-9);
    a = edge_arrow_of(axis, -300, 10, false, in); // behind, and by perspective mirrored: to the right of the viewer
    EXPECT_TRUE(!a.inside && a.dx > 0.9);
    a = edge_arrow_of(axis, 0, 0, false, in); // straight behind: either way
    EXPECT_NEAR(a.dx * a.dx + a.dy * a.dy, 1, 1e-9);
    struct rng rng = {SEED};
    for (int i = 0; i < 500; i++) {
        a = edge_arrow_of(axis, rng_between(&rng, -4000, 4000), rng_between(&rng, -4000, 4000), i % 2, in);
        EXPECT_NEAR(a.dx * a.dx + a.dy * a.dy, 1, 1e-9);
        if (!a.inside) {
            EXPECT_TRUE(a.at.x >= 34 - 1e-9 && a.at.x <= 34 + 1212 + 1e-9 && a.at.y >= 34 - 1e-9 &&
                        a.at.y <= 34 + 732 + 1e-9);
        }
    }
}

static void test_labels_fade(void **state)
{
    (void)state;
    EXPECT_AT_LEAST(room_label_opacity(0.5, 0.002, false), 0.98);
    EXPECT_NEAR(room_label_opacity(8, 0, false), 0.5, 1e-9);
    EXPECT_AT_MOST(room_label_opacity(2, 0.5, false), 0.25);
    EXPECT_AT_MOST(room_label_opacity(2, 0.01, true), 0.5 * room_label_opacity(2, 0.01, false) + 1e-9);
    EXPECT_NEAR(room_label_opacity(NAN, 0, false), 0, 0);
}

static void test_names_are_found(void **state)
{
    (void)state;
    struct room_state s = room_state_start();
    EXPECT_TRUE(!room_state_type(&s, " ") && !room_state_type(&s, "\x1b"));
    EXPECT_TRUE(room_state_type(&s, "dumbbell and more "));
    EXPECT_TRUE(room_state_type(&s, "than thirty-one letters"));
    EXPECT_INT(strlen(s.filter), ROOM_FILTER_BYTES - 1);
    EXPECT_TRUE(!room_state_type(&s, "x"));
    room_state_want(&s, 2);
    EXPECT_INT(s.wanted, 2);
    room_state_want(&s, 2);
    EXPECT_INT(s.wanted, ROOM_NOTHING);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_label_covers_another),  cmocka_unit_test(test_a_label_keeps_its_side),
        cmocka_unit_test(test_the_arrow_points_the_way), cmocka_unit_test(test_labels_fade),
        cmocka_unit_test(test_names_are_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
