// Choosing frames: equation 5 against a second, plainer telling of it; ties,
// unknown joints, bad numbers, nothing to choose from; and the choice for a part.
#include "tests/support/test.h"

#include "reenact/retrieval/frame_selection.h"
#include "tests/support/limbs.h"

enum { FRAMES = 60, SEED = 20140701 };

static struct skeleton random_skeleton(struct dice *dice, double unknown)
{
    struct skeleton s;
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.joint[j] = v3_add(v3(0, 0, 3), dice_normal3(dice, 1));
        s.confidence[j] = dice_uniform(dice) < unknown ? 0 : 1;
    }
    return s;
}

// Equation 5, told coordinate by coordinate. -1: nothing comparable.
static int plain_choice(const struct skeleton *k, const struct skeleton *frames, int count, double *cost)
{
    int best = -1, wanted = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        wanted += k->confidence[j] > 0 ? 1 : 0;
    for (int n = count - 1; n >= 0; n--) { // from the back, so that ties go to the lowest by <=
        double total = 0, used = 0;
        const double *kn = &k->joint[JOINT_NECK].x, *nn = &frames[n].joint[JOINT_NECK].x;
        for (int j = 0; j < JOINT_COUNT; j++) {
            const double *kj = &k->joint[j].x, *nj = &frames[n].joint[j].x;
            double square = 0;
            for (int axis = 0; axis < 3; axis++)
                square += pow((kj[axis] - kn[axis]) - (nj[axis] - nn[axis]), 2);
            if (k->confidence[j] > 0 && frames[n].confidence[j] > 0) {
                total += sqrt(square);
                used += 1;
            }
        }
        if (frames[n].confidence[JOINT_NECK] == 0 || 2 * used < wanted)
            continue;
        double mean = total * 16 / used;
        if (best < 0 || mean <= *cost) {
            best = n;
            *cost = mean;
        }
    }
    return k->confidence[JOINT_NECK] > 0 ? best : -1;
}

static void equation_5_is_exact(void **state)
{
    (void)state;
    struct dice dice = {SEED};
    print_message("seed %d\n", SEED);
    int answers = 0, nothings = 0;
    for (int round = 0; round < 200; round++) {
        double unknown = round % 4 * 0.25;
        struct skeleton frames[FRAMES];
        struct selector *s;
        EXPECT_STATUS(selector_open(&s, FRAMES), OK);
        for (int n = 0; n < FRAMES; n++) {
            frames[n] = random_skeleton(&dice, unknown);
            EXPECT_STATUS(selector_add(s, 3 * n, &frames[n], NULL), OK);
        }
        struct skeleton k = random_skeleton(&dice, unknown);
        double cost = 0;
        int wanted = plain_choice(&k, frames, FRAMES, &cost);
        struct selection got = {-1, -1};
        enum status status = select_whole(s, &k, &got);
        EXPECT_STATUS(status, wanted < 0 ? NOTHING : OK);
        if (wanted >= 0) {
            EXPECT_INT(got.frame, 3 * wanted);
            EXPECT_NEAR(got.cost_m, cost, 1e-9);
        }
        answers += wanted >= 0;
        nothings += wanted < 0;
        selector_close(&s);
    }
    EXPECT_AT_LEAST(answers, 100);
    EXPECT_AT_LEAST(nothings, 10);
}

static void ties_go_to_the_lowest(void **state)
{
    (void)state;
    struct dice dice = {SEED + 1};
    struct skeleton a = random_skeleton(&dice, 0), b = random_skeleton(&dice, 0), moved = a;
    for (int j = 0; j < JOINT_COUNT; j++) // by a power of two, so that the differences stay the same to the bit
        moved.joint[j] = v3_add(a.joint[j], v3(0, 0, 0));
    struct selector *s;
    EXPECT_STATUS(selector_open(&s, 4), OK);
    EXPECT_STATUS(selector_add(s, 5, &b, NULL), OK);
    EXPECT_STATUS(selector_add(s, 6, &a, NULL), OK);
    EXPECT_STATUS(selector_add(s, 7, &moved, NULL), OK);
    EXPECT_STATUS(selector_add(s, 8, &a, NULL), OK);
    struct selection got;
    EXPECT_STATUS(select_whole(s, &a, &got), OK);
    EXPECT_INT(got.frame, 6);
    EXPECT_NEAR(got.cost_m, 0, 1e-12);
    for (int p = 0; p < PART_COUNT; p++) {
        EXPECT_STATUS(select_part(s, &a, (enum part)p, &got), OK);
        EXPECT_INT(got.frame, 6);
    }
    selector_exclude(s, 6, PART_HEAD);
    EXPECT_STATUS(select_part(s, &a, PART_HEAD, &got), OK);
    EXPECT_INT(got.frame, 7);
    EXPECT_STATUS(select_part(s, &a, PART_LEFT_SHIN, &got), OK);
    EXPECT_INT(got.frame, 6);
    selector_close(&s);
}

// A frame far away in the room costs nothing: necks are laid on each other.
static void where_the_actor_stands_does_not_matter(void **state)
{
    (void)state;
    struct dice dice = {SEED + 2};
    struct skeleton a = random_skeleton(&dice, 0), far = a, near = a;
    for (int j = 0; j < JOINT_COUNT; j++)
        far.joint[j] = v3_add(a.joint[j], v3(100, -20, 7));
    near.joint[JOINT_LEFT_HAND].x += 0.01;
    struct selector *s;
    EXPECT_STATUS(selector_open(&s, 2), OK);
    EXPECT_STATUS(selector_add(s, 0, &near, NULL), OK);
    EXPECT_STATUS(selector_add(s, 1, &far, NULL), OK);
    struct selection got;
    EXPECT_STATUS(select_whole(s, &a, &got), OK);
    EXPECT_INT(got.frame, 1);
    EXPECT_NEAR(got.cost_m, 0, 1e-9);
    selector_close(&s);
}

static void bad_numbers_are_refused(void **state)
{
    (void)state;
    struct dice dice = {SEED + 3};
    struct skeleton good = random_skeleton(&dice, 0), bad = good, unknown = good;
    bad.joint[JOINT_RIGHT_KNEE].y = NAN;
    unknown.joint[JOINT_RIGHT_KNEE].y = INFINITY;
    unknown.confidence[JOINT_RIGHT_KNEE] = 0; // means nothing, so it may be anything
    struct selector *s;
    EXPECT_STATUS(selector_open(&s, 2), OK);
    struct selection got = {-7, -7};
    EXPECT_STATUS(select_whole(s, &good, &got), NOTHING); // empty
    EXPECT_STATUS(select_part(s, &good, PART_HEAD, &got), NOTHING);
    EXPECT_STATUS(selector_add(s, 0, &bad, NULL), ERR_INPUT);
    EXPECT_STATUS(select_whole(s, &good, &got), NOTHING); // still empty
    EXPECT_STATUS(selector_add(s, 0, &good, NULL), OK);
    EXPECT_STATUS(select_whole(s, &bad, &got), ERR_INPUT);
    EXPECT_STATUS(select_part(s, &bad, PART_HEAD, &got), ERR_INPUT);
    EXPECT_INT(got.frame, -7);
    EXPECT_STATUS(select_whole(s, &unknown, &got), OK);
    EXPECT_NEAR(got.cost_m, 0, 1e-12);
    EXPECT_STATUS(select_part(s, &unknown, PART_RIGHT_SHIN, &got), NOTHING);
    struct skeleton nobody = good;
    for (int j = 0; j < JOINT_COUNT; j++)
        nobody.confidence[j] = 0;
    EXPECT_STATUS(select_whole(s, &nobody, &got), NOTHING);
    selector_close(&s);
    EXPECT_TRUE(s == NULL);
    selector_close(&s); // accepts NULL
}

// Somebody who stands with arms a little out and turns by `angle` about the
// upright, 3 m before the camera; 0 faces it. Camera axes.
static struct skeleton standing(double angle)
{
    static const double at[JOINT_COUNT][3] = {
        // to the person's left, up, to the front
        [JOINT_HEAD] = {0, 0.25, 0.02},
        [JOINT_NECK] = {0, 0, 0},
        [JOINT_LEFT_SHOULDER] = {0.18, -0.03, 0},
        [JOINT_LEFT_ELBOW] = {0.30, -0.28, 0},
        [JOINT_LEFT_HAND] = {0.38, -0.5, 0.05},
        [JOINT_RIGHT_SHOULDER] = {-0.18, -0.03, 0},
        [JOINT_RIGHT_ELBOW] = {-0.30, -0.28, 0},
        [JOINT_RIGHT_HAND] = {-0.38, -0.5, 0.05},
        [JOINT_TORSO] = {0, -0.3, 0},
        [JOINT_WAIST] = {0, -0.52, 0},
        [JOINT_LEFT_HIP] = {0.1, -0.55, 0},
        [JOINT_LEFT_KNEE] = {0.12, -0.98, 0.03},
        [JOINT_LEFT_FOOT] = {0.12, -1.4, 0},
        [JOINT_RIGHT_HIP] = {-0.1, -0.55, 0},
        [JOINT_RIGHT_KNEE] = {-0.12, -0.98, 0.03},
        [JOINT_RIGHT_FOOT] = {-0.12, -1.4, 0},
    };
    struct skeleton s;
    for (int j = 0; j < JOINT_COUNT; j++) {
        double left = at[j][0], front = at[j][2];
        s.joint[j] =
            v3(left * cos(angle) + front * sin(angle), -at[j][1] - 0.5, 3 - front * cos(angle) + left * sin(angle));
        s.confidence[j] = 1;
    }
    return s;
}

static const struct body plain_body = {
    .radius_rate = {0.4, 0.4, 0.5, 0.15, 0.12, 0.15, 0.12, 0.17, 0.12, 0.17, 0.12},
};

// A recorded full turn: the frame that shows a part's side is found for each part,
// wherever the viewer stands, to half the step between frames.
static void a_part_finds_its_side(void **state)
{
    (void)state;
    enum { STEPS = 72 };
    struct selector *s;
    EXPECT_STATUS(selector_open(&s, STEPS), OK);
    for (int n = 0; n < STEPS; n++) {
        struct skeleton frame = standing(n * 2 * 3.14159265358979 / STEPS);
        EXPECT_STATUS(selector_add(s, n, &frame, NULL), OK);
    }
    for (int n = 0; n < STEPS; n++) {
        struct skeleton wanted = standing((n + 0.3) * 2 * 3.14159265358979 / STEPS);
        for (int p = 0; p < PART_COUNT; p++) {
            struct selection got;
            EXPECT_STATUS(select_part(s, &wanted, (enum part)p, &got), OK);
            EXPECT_INT(got.frame, n);
        }
    }
    selector_close(&s);
}

// The same sides twice, once with the left forearm hidden behind the trunk.
static void hidden_parts_are_passed_over(void **state)
{
    (void)state;
    struct skeleton front = standing(0), behind = standing(0);
    // Elbow at the side, hand in the small of the back: from the front the forearm is hidden.
    behind.joint[JOINT_LEFT_ELBOW] = v3_add(behind.joint[JOINT_TORSO], v3(0.10, 0, 0.25));
    behind.joint[JOINT_LEFT_HAND] = v3_add(behind.joint[JOINT_TORSO], v3(-0.12, 0.05, 0.25));
    struct skeleton wanted = behind;
    struct selector *with, *without;
    EXPECT_STATUS(selector_open(&with, 2), OK);
    EXPECT_STATUS(selector_open(&without, 2), OK);
    EXPECT_STATUS(selector_add(with, 0, &behind, &plain_body), OK);
    EXPECT_STATUS(selector_add(with, 1, &front, &plain_body), OK);
    EXPECT_STATUS(selector_add(without, 0, &behind, NULL), OK);
    EXPECT_STATUS(selector_add(without, 1, &front, NULL), OK);
    struct selection seen, blind;
    EXPECT_STATUS(select_part(with, &wanted, PART_LEFT_FOREARM, &seen), OK);
    EXPECT_STATUS(select_part(without, &wanted, PART_LEFT_FOREARM, &blind), OK);
    EXPECT_INT(blind.frame, 0); // the joints alone fit to the millimetre
    EXPECT_NEAR(blind.cost_m, 0, 1e-9);
    EXPECT_AT_LEAST(seen.cost_m, 0.1); // but it cannot be seen there
    selector_close(&with);
    selector_close(&without);
}

static enum status choose(const struct selector *s, const struct skeleton *k, int p, struct selection *out)
{
    return p < PART_COUNT ? select_part(s, k, (enum part)p, out) : select_whole(s, k, out);
}

// A moving person, some joints unknown, some frames twice: the frame chosen for
// each part is the first of those that are cheapest when they are the only choice.
static void parts_are_chosen_as_if_each_frame_were_looked_at(void **state)
{
    (void)state;
    enum { LONG = 700, VIEWS = 12 };
    struct dice dice = {SEED + 6};
    struct limbs limbs = limbs_random(&dice);
    static struct skeleton frames[LONG];
    static struct selector *alone[LONG];
    struct selector *s;
    EXPECT_STATUS(selector_open(&s, LONG), OK);
    for (int n = 0; n < LONG; n++) {
        frames[n] = n % 50 == 49 ? frames[n / 2] : limbs_at(&limbs, n / 30.0, 0.01, &dice);
        for (int j = 0; j < JOINT_COUNT; j++)
            if (dice_uniform(&dice) < (n % 3 ? 0.03 : 0))
                frames[n].confidence[j] = dice_uniform(&dice) < 0.5 ? 0 : 0.5f;
        EXPECT_STATUS(selector_open(&alone[n], 1), OK);
        EXPECT_STATUS(selector_add(s, n, &frames[n], &plain_body), OK);
        EXPECT_STATUS(selector_add(alone[n], n, &frames[n], &plain_body), OK);
    }
    for (int view = 0; view < VIEWS; view++) {
        int shown = (int)(dice_uniform(&dice) * LONG);
        struct skeleton k = frames[shown];
        if (view % 4)
            k = limbs_turned(&k, 6 * dice_uniform(&dice), 0.02, &dice);
        if (view == VIEWS / 3)
            EXPECT_STATUS(selector_settle(s), OK);
        for (int n = 0; view == VIEWS / 2 && n < LONG; n += 2) {
            selector_exclude(s, n, PART_LEFT_SHIN);
            selector_exclude(alone[n], n, PART_LEFT_SHIN);
        }
        struct selection together[PART_COUNT + 1];
        EXPECT_TRUE(select_parts(s, &k, together) >= OK);
        for (int p = 0; p <= PART_COUNT; p++) { // the last one is the whole
            struct selection best = {-1, 0}, got = {-1, 0}, one;
            for (int n = 0; n < LONG; n++)
                if (choose(alone[n], &k, p, &one) == OK && (best.frame < 0 || one.cost_m < best.cost_m))
                    best = one;
            EXPECT_STATUS(choose(s, &k, p, &got), best.frame < 0 ? NOTHING : OK);
            EXPECT_INT(got.frame, best.frame);
            EXPECT_TRUE(got.cost_m == best.cost_m);
            EXPECT_TRUE(p == PART_COUNT || (together[p].frame == best.frame && together[p].cost_m == best.cost_m));
        }
    }
    for (int n = 0; n < LONG; n++)
        selector_close(&alone[n]);
    selector_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equation_5_is_exact),
        cmocka_unit_test(ties_go_to_the_lowest),
        cmocka_unit_test(where_the_actor_stands_does_not_matter),
        cmocka_unit_test(bad_numbers_are_refused),
        cmocka_unit_test(a_part_finds_its_side),
        cmocka_unit_test(hidden_parts_are_passed_over),
        cmocka_unit_test(parts_are_chosen_as_if_each_frame_were_looked_at),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
