// The nearest point against asking about every one, where that is hard: ties,
// duplicates, all alike, one point, none, points that may not be chosen, places
// that are unknown, far away or no numbers, costs of their own, and counts next
// to where blocks begin.
#include "tests/support/test.h"

#include "reenact/retrieval/pose_index.h"

#include <string.h>

enum { SEED = 47, MOST = 34000 };

struct crowd {
    int places, count, asked;
    int numbers[MOST]; // [slot]
    bool barred[MOST];
    struct nearest_point points[MOST];
    struct nearest_point wanted;
    double scale;
};

// `scale` times the sum, and a little more for every third, so that it is not the bound itself.
static double cost_of(const void *context, int64_t slot)
{
    struct crowd *c = (struct crowd *)(uintptr_t)context;
    const int number = c->numbers[slot];
    const struct nearest_point *p = &c->points[number];
    c->asked++;
    if (c->barred[number])
        return -1;
    double sum = p->own_m;
    for (int i = 0; i < c->places; i++)
        if ((p->known & c->wanted.known) >> i & 1)
            sum += v3_distance(p->place[i], c->wanted.place[i]);
    return c->scale * sum + (number % 3 ? 0 : 0.05);
}

// In the order in which they came, and settled.
enum { WAYS = 2 };

// Returns how many points were asked about, on average.
static int compare(struct crowd *c)
{
    int64_t wanted = -1;
    double least = 0;
    for (int i = 0; i < c->count; i++)
        c->numbers[i] = i;
    for (int i = 0; i < c->count; i++) {
        double here = cost_of(c, i);
        if (here >= 0 && (wanted < 0 || here < least)) {
            wanted = i;
            least = here;
        }
    }
    c->asked = 0;
    for (int way = 0; way < WAYS; way++) {
        struct nearest *n;
        EXPECT_STATUS(nearest_open(&n, c->places, 1.0 / 2048, c->count), OK);
        for (int i = 0; i < c->count; i++)
            nearest_add(n, &c->points[i]);
        if (way == 1)
            EXPECT_STATUS(nearest_settle(n, c->numbers, sizeof *c->numbers), OK);
        struct nearest_query q = {n, c->wanted, c->scale, c, -1, 0};
        nearest_find_all(&q, 1, cost_of);
        EXPECT_INT(q.number, wanted);
        if (wanted >= 0)
            EXPECT_TRUE(q.cost_m == least);
        for (int i = 0; i < c->count; i += 1 + c->count / 4)
            EXPECT_INT(c->numbers[nearest_slot(n, i)], i);
        nearest_close(&n);
    }
    return c->asked / WAYS;
}

static struct nearest_point near_to(const struct nearest_point *p, int places, double step_m, struct dice *dice)
{
    struct nearest_point next = *p;
    for (int i = 0; i < places; i++)
        next.place[i] = v3_add(p->place[i], dice_normal3(dice, step_m));
    return next;
}

static struct crowd *walk(int places, int count, double step_m, struct dice *dice)
{
    static struct crowd c;
    memset(c.barred, 0, (size_t)count * sizeof *c.barred);
    c.places = places;
    c.count = count;
    c.scale = 1;
    c.asked = 0;
    struct nearest_point at = {.known = (1u << places) - 1};
    for (int i = 0; i < count; i++)
        c.points[i] = at = near_to(&at, places, step_m, dice);
    c.wanted = near_to(&c.points[count ? (int)(dice_uniform(dice) * count) : 0], places, 0.05, dice);
    c.wanted.known = at.known;
    return &c;
}

static void every_count_up_to_three_groups(void **state)
{
    (void)state;
    struct dice dice = {SEED};
    print_message("seed %d\n", SEED);
    int asked = 0, all = 0;
    for (int count = 0; count < 700; count += count < 40 || count % 256 > 250 || count % 256 < 5 ? 1 : 7) {
        asked += compare(walk(1 + count % NEAREST_PLACES_MOST, count, 0.05, &dice));
        all += count;
    }
    EXPECT_AT_MOST(asked, 0.25 * all); // or it would be no better than asking about all
}

static void ties_go_to_the_lowest(void **state)
{
    (void)state;
    struct dice dice = {SEED + 1};
    for (int round = 0; round < 60; round++) {
        struct crowd *c = walk(1 + round % 16, 100 + 9 * round, 0.1, &dice);
        if (round % 3 == 0) // all alike
            for (int i = 0; i < c->count; i++)
                c->points[i] = c->points[0];
        else // copies here and there
            for (int k = 0; k < c->count / 2; k++) {
                int from = (int)(dice_uniform(&dice) * c->count), to = (int)(dice_uniform(&dice) * c->count);
                c->points[to] = c->points[from];
            }
        c->wanted = c->points[c->count / 2];
        compare(c);
    }
}

static void some_may_not_be_chosen(void **state)
{
    (void)state;
    struct dice dice = {SEED + 2};
    for (int round = 0; round < 60; round++) {
        struct crowd *c = walk(4, 300, 0.05, &dice);
        for (int i = 0; i < c->count; i++)
            c->barred[i] = dice_uniform(&dice) < round / 50.0; // in the last rounds none is left
        compare(c);
    }
}

// Before one that may be chosen is found, all points, blocks and groups may hold it: more than can wait at once.
static void where_nothing_can_be_passed_over(void **state)
{
    (void)state;
    struct dice dice = {SEED + 8};
    for (int round = 0; round < 4; round++) {
        struct crowd *c = walk(1 + round, MOST, 0.002, &dice);
        for (int i = 0; i < c->count; i++)
            c->barred[i] = true;
        if (round > 0)
            c->barred[(int)(dice_uniform(&dice) * c->count)] = false;
        int asked = compare(c);
        EXPECT_TRUE(round > 0 || asked >= c->count);
    }
}

static void unknown_places_cost_nothing(void **state)
{
    (void)state;
    struct dice dice = {SEED + 3};
    for (int round = 0; round < 100; round++) {
        struct crowd *c = walk(15, 400, 0.05, &dice);
        double unknown = round % 5 * 0.25;
        for (int i = 0; i < c->count; i++)
            for (int p = 0; p < c->places; p++)
                if (dice_uniform(&dice) < unknown) {
                    c->points[i].known &= ~(1u << p);
                    c->points[i].place[p] = v3(NAN, INFINITY, 1e300);
                }
        for (int p = 0; p < c->places; p++)
            if (dice_uniform(&dice) < 0.2) {
                c->wanted.known &= ~(1u << p);
                c->wanted.place[p] = v3(NAN, NAN, NAN);
            }
        c->scale = 1 + round % 7 * 0.3;
        compare(c);
    }
}

static void what_a_point_costs_by_itself_counts(void **state)
{
    (void)state;
    struct dice dice = {SEED + 4};
    for (int round = 0; round < 60; round++) {
        struct crowd *c = walk(4, 500, 0.05, &dice);
        for (int i = 0; i < c->count; i++)
            c->points[i].own_m = pow(10, 6 * dice_uniform(&dice) - 5);
        c->scale = 1 + round % 7 * 0.3;
        compare(c);
    }
}

static void places_far_away_and_no_numbers(void **state)
{
    (void)state;
    struct dice dice = {SEED + 5};
    static const double far[] = {3.9, 4.1, 1e3, 1e9, 1e300};
    for (int round = 0; round < 100; round++) {
        struct crowd *c = walk(6, 200, 0.05, &dice);
        double size = far[round % 5];
        for (int i = 0; i < c->count; i++)
            if (round % 2 || i % 10 == 0)
                for (int p = 0; p < c->places; p++)
                    c->points[i].place[p] = v3_scale(c->points[i].place[p], size);
        if (round % 3 == 0)
            c->wanted.place[2] = v3(size, -size, 0);
        if (round % 10 == 9) // its cost is no number, so it cannot be chosen
            c->points[7].place[0] = v3(NAN, 0, 0);
        compare(c);
    }
}

// Six places and an own cost count up to 4681 each: that fills 16 bits to the last.
static void all_that_counts_is_too_far_to_count(void **state)
{
    (void)state;
    struct dice dice = {SEED + 7};
    for (int round = 0; round < 20; round++) {
        struct crowd *c = walk(6, 200, 0.05, &dice);
        for (int i = 0; i < c->count; i++) {
            c->points[i].own_m = 1e3;
            for (int p = 0; p < c->places; p++)
                c->points[i].place[p] = v3_add(c->wanted.place[p], v3(20 + dice_uniform(&dice), 20, 20));
        }
        for (int p = 0; p < c->places; p++)
            c->wanted.place[p] = v3_scale(c->wanted.place[p], -1);
        compare(c);
    }
}

// Along this direction a place's bound is its distance, so rounding alone can make it too high.
static void bounds_are_not_too_high_where_they_are_tight(void **state)
{
    (void)state;
    struct dice dice = {SEED + 6};
    for (int round = 0; round < 2000; round++) {
        struct crowd *c = walk(1 + round % 4, 100, 0.05, &dice);
        for (int i = 0; i < c->count; i++)
            for (int p = 0; p < c->places; p++)
                c->points[i].place[p] =
                    v3_add(c->wanted.place[p], v3_scale(v3(0.86, 0.36, 0.36), 0.2 + 1e-3 * dice_uniform(&dice)));
        compare(c);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_count_up_to_three_groups),
        cmocka_unit_test(ties_go_to_the_lowest),
        cmocka_unit_test(some_may_not_be_chosen),
        cmocka_unit_test(where_nothing_can_be_passed_over),
        cmocka_unit_test(unknown_places_cost_nothing),
        cmocka_unit_test(what_a_point_costs_by_itself_counts),
        cmocka_unit_test(places_far_away_and_no_numbers),
        cmocka_unit_test(all_that_counts_is_too_far_to_count),
        cmocka_unit_test(bounds_are_not_too_high_where_they_are_tight),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
