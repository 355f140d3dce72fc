// Frame selection: [D14] eq. 5 against a plain implementation; ties, unknown joints, bad
// numbers, no frames; and selection for a part against exhaustive search.
#include "tests/support/test.h"

#include "reenact/retrieval/frame_selection.h"
#include "tests/support/limbs.h"

enum { FRAMES = 60, SEED = 20140701 };

static struct skeleton random_skeleton(struct rng *rng, double unknown)
{
    struct skeleton s = {0};
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.joint[j] = v3_add(v3(0, 0, 3), rng_normal3(rng, 1));
        s.confidence[j] = rng_uniform(rng) < unknown ? 0 : 1;
    }
    return s;
}

// Eq. 5, coordinate by coordinate. -1: nothing comparable.
static int plain_selection(const struct skeleton *k, const struct skeleton *frames, int count, double *cost)
{
    int best = -1, known = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        known += k->confidence[j] > 0 ? 1 : 0;
    for (int n = count - 1; n >= 0; n--) { // backwards, so that with <= ties go to the lowest
        double total = 0, used = 0;
        const struct vec3 kn = k->joint[JOINT_NECK], nn = frames[n].joint[JOINT_NECK];
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 kj = k->joint[j], nj = frames[n].joint[j];
            const double square = pow((kj.x - kn.x) - (nj.x - nn.x), 2) + pow((kj.y - kn.y) - (nj.y - nn.y), 2) +
                                  pow((kj.z - kn.z) - (nj.z - nn.z), 2);
            if (k->confidence[j] > 0 && frames[n].confidence[j] > 0) {
                total += sqrt(square);
                used += 1;
            }
        }
        if (frames[n].confidence[JOINT_NECK] == 0 || 2 * used < known)
            continue;
        double mean = total * 16 / used;
        if (best < 0 || mean <= *cost) {
            best = n;
            *cost = mean;
        }
    }
    return k->confidence[JOINT_NECK] > 0 ? best : -1;
}

static void test_equation_5_is_exact(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    print_message("seed %d\n", SEED);
    int answers = 0, nothings = 0;
    for (int round = 0; round < 200; round++) {
        double unknown = round % 4 * 0.25;
        struct skeleton frames[FRAMES];
        struct frame_selector *s;
        EXPECT_STATUS(frame_selector_open(&s, FRAMES), OK);
        for (int n = 0; n < FRAMES; n++) {
            frames[n] = random_skeleton(&rng, unknown);
            EXPECT_STATUS(frame_selector_add(s, 3 * n, &frames[n], NULL), OK);
        }
        struct skeleton k = random_skeleton(&rng, unknown);
        double cost = 0;
        int wanted = plain_selection(&k, frames, FRAMES, &cost);
        struct frame_selection got = {-1, -1};
        enum status status = frame_selector_find_body(s, &k, &got);
        EXPECT_STATUS(status, wanted < 0 ? NOTHING : OK);
        if (wanted >= 0) {
            EXPECT_INT(got.frame, 3 * wanted);
            EXPECT_NEAR(got.cost_m, cost, 1e-9);
        }
        answers += wanted >= 0;
        nothings += wanted < 0;
        frame_selector_close(&s);
    }
    EXPECT_AT_LEAST(answers, 100);
    EXPECT_AT_LEAST(nothings, 10);
}

static void test_ties_go_to_lowest(void **state)
{
    (void)state;
    struct rng rng = {SEED + 1};
    struct skeleton a = random_skeleton(&rng, 0), b = random_skeleton(&rng, 0);
    struct frame_selector *s;
    EXPECT_STATUS(frame_selector_open(&s, 4), OK);
    EXPECT_STATUS(frame_selector_add(s, 5, &b, NULL), OK);
    EXPECT_STATUS(frame_selector_add(s, 6, &a, NULL), OK);
    EXPECT_STATUS(frame_selector_add(s, 7, &a, NULL), OK);
    EXPECT_STATUS(frame_selector_add(s, 8, &a, NULL), OK);
    struct frame_selection got;
    EXPECT_STATUS(frame_selector_find_body(s, &a, &got), OK);
    EXPECT_INT(got.frame, 6);
    EXPECT_NEAR(got.cost_m, 0, 1e-12);
    for (int p = 0; p < PART_COUNT; p++) {
        EXPECT_STATUS(frame_selector_find_part(s, &a, (enum part)p, &got), OK);
        EXPECT_INT(got.frame, 6);
    }
    frame_selector_exclude(s, 6, PART_HEAD);
    EXPECT_STATUS(frame_selector_find_part(s, &a, PART_HEAD, &got), OK);
    EXPECT_INT(got.frame, 7);
    EXPECT_STATUS(frame_selector_find_part(s, &a, PART_LEFT_SHIN, &got), OK);
    EXPECT_INT(got.frame, 6);
    frame_selector_close(&s);
}

// A frame far away in the room costs nothing: skeletons are compared relative to their necks.
static void test_translation_invariant(void **state)
{
    (void)state;
    struct rng rng = {SEED + 2};
    struct skeleton a = random_skeleton(&rng, 0), far = a, close = a;
    for (int j = 0; j < JOINT_COUNT; j++)
        far.joint[j] = v3_add(a.joint[j], v3(100, -20, 7));
    close.joint[JOINT_LEFT_HAND].x += 0.01;
    struct frame_selector *s;
    EXPECT_STATUS(frame_selector_open(&s, 2), OK);
    EXPECT_STATUS(frame_selector_add(s, 0, &close, NULL), OK);
    EXPECT_STATUS(frame_selector_add(s, 1, &far, NULL), OK);
    struct frame_selection got;
    EXPECT_STATUS(frame_selector_find_body(s, &a, &got), OK);
    EXPECT_INT(got.frame, 1);
    EXPECT_NEAR(got.cost_m, 0, 1e-9);
    frame_selector_close(&s);
}

static void test_bad_numbers_are_refused(void **state)
{
    (void)state;
    struct rng rng = {SEED + 3};
    struct skeleton good = random_skeleton(&rng, 0), bad = good, unknown = good;
    bad.joint[JOINT_RIGHT_KNEE].y = NAN;
    unknown.joint[JOINT_RIGHT_KNEE].y = INFINITY;
    unknown.confidence[JOINT_RIGHT_KNEE] = 0; // unknown, so its position is ignored
    struct frame_selector *s;
    EXPECT_STATUS(frame_selector_open(&s, 2), OK);
    struct frame_selection got = {-7, -7};
    EXPECT_STATUS(frame_selector_find_body(s, &good, &got), NOTHING); // empty
    EXPECT_STATUS(frame_selector_find_part(s, &good, PART_HEAD, &got), NOTHING);
    EXPECT_STATUS(frame_selector_add(s, 0, &bad, NULL), ERR_INPUT);
    EXPECT_STATUS(frame_selector_find_body(s, &good, &got), NOTHING); // still empty
    EXPECT_STATUS(frame_selector_add(s, 0, &good, NULL), OK);
    EXPECT_STATUS(frame_selector_find_body(s, &bad, &got), ERR_INPUT);
    EXPECT_STATUS(frame_selector_find_part(s, &bad, PART_HEAD, &got), ERR_INPUT);
    EXPECT_INT(got.frame, -7);
    EXPECT_STATUS(frame_selector_find_body(s, &unknown, &got), OK);
    EXPECT_NEAR(got.cost_m, 0, 1e-12);
    EXPECT_STATUS(frame_selector_find_part(s, &unknown, PART_RIGHT_SHIN, &got), NOTHING);
    struct skeleton unknown_joints = good;
    for (int j = 0; j < JOINT_COUNT; j++)
        unknown_joints.confidence[j] = 0;
    EXPECT_STATUS(frame_selector_find_body(s, &unknown_joints, &got), NOTHING);
    frame_selector_close(&s);
    EXPECT_TRUE(s == NULL);
    frame_selector_close(&s); // accepts NULL
}

// A standing person with arms slightly outwards, rotated by `angle` about the
// vertical, 3 m before the camera; 0 faces it. Camera axes.
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
    struct skeleton s = {0};
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

// A recorded full rotation: for each part and viewpoint the frame with the nearest viewing
// direction is selected, to half the step between frames.
static void test_part_selects_visible_side(void **state)
{
    (void)state;
    enum { STEPS = 72 };
    struct frame_selector *s;
    EXPECT_STATUS(frame_selector_open(&s, STEPS), OK);
    for (int n = 0; n < STEPS; n++) {
        struct skeleton frame = standing(n * 2 * 3.14159265358979 / STEPS);
        EXPECT_STATUS(frame_selector_add(s, n, &frame, NULL), OK);
    }
    for (int n = 0; n < STEPS; n++) {
        struct skeleton wanted = standing((n + 0.3) * 2 * 3.14159265358979 / STEPS);
        for (int p = 0; p < PART_COUNT; p++) {
            struct frame_selection got;
            EXPECT_STATUS(frame_selector_find_part(s, &wanted, (enum part)p, &got), OK);
            EXPECT_INT(got.frame, n);
        }
    }
    frame_selector_close(&s);
}

// The same side twice, once with the left forearm hidden behind the trunk.
static void test_hidden_parts_are_skipped(void **state)
{
    (void)state;
    struct skeleton front = standing(0), behind = standing(0);
    // Elbow at the side, hand in the small of the back: from the front the forearm is hidden.
    behind.joint[JOINT_LEFT_ELBOW] = v3_add(behind.joint[JOINT_TORSO], v3(0.10, 0, 0.25));
    behind.joint[JOINT_LEFT_HAND] = v3_add(behind.joint[JOINT_TORSO], v3(-0.12, 0.05, 0.25));
    struct skeleton wanted = behind;
    struct frame_selector *with, *without;
    EXPECT_STATUS(frame_selector_open(&with, 2), OK);
    EXPECT_STATUS(frame_selector_open(&without, 2), OK);
    EXPECT_STATUS(frame_selector_add(with, 0, &behind, &plain_body), OK);
    EXPECT_STATUS(frame_selector_add(with, 1, &front, &plain_body), OK);
    EXPECT_STATUS(frame_selector_add(without, 0, &behind, NULL), OK);
    EXPECT_STATUS(frame_selector_add(without, 1, &front, NULL), OK);
    struct frame_selection seen, blind;
    EXPECT_STATUS(frame_selector_find_part(with, &wanted, PART_LEFT_FOREARM, &seen), OK);
    EXPECT_STATUS(frame_selector_find_part(without, &wanted, PART_LEFT_FOREARM, &blind), OK);
    EXPECT_INT(blind.frame, 0); // the joints alone are equal
    EXPECT_NEAR(blind.cost_m, 0, 1e-9);
    EXPECT_AT_LEAST(seen.cost_m, 0.1); // but the forearm is occluded there
    frame_selector_close(&with);
    frame_selector_close(&without);
}

static enum status choose(const struct frame_selector *s, const struct skeleton *k, int p, struct frame_selection *out)
{
    return p < PART_COUNT ? frame_selector_find_part(s, k, (enum part)p, out) : frame_selector_find_body(s, k, out);
}

// A moving person, some joints unknown, some frames twice: the frame selected for each part
// is the first of those with the least cost, each evaluated in a selector of its own.
static void test_part_selection_matches_exhaustive_search(void **state)
{
    (void)state;
    enum { LONG = 700, VIEWS = 12 };
    struct rng rng = {SEED + 6};
    struct limbs limbs = limbs_random(&rng);
    static struct skeleton frames[LONG];
    static struct frame_selector *alone[LONG];
    struct frame_selector *s;
    EXPECT_STATUS(frame_selector_open(&s, LONG), OK);
    for (int n = 0; n < LONG; n++) {
        frames[n] = n % 50 == 49 ? frames[n / 2] : limbs_at(&limbs, n / 30.0, 0.01, &rng);
        for (int j = 0; j < JOINT_COUNT; j++)
            if (rng_uniform(&rng) < (n % 3 ? 0.03 : 0))
                frames[n].confidence[j] = rng_uniform(&rng) < 0.5 ? 0 : 0.5f;
        EXPECT_STATUS(frame_selector_open(&alone[n], 1), OK);
        EXPECT_STATUS(frame_selector_add(s, n, &frames[n], &plain_body), OK);
        EXPECT_STATUS(frame_selector_add(alone[n], n, &frames[n], &plain_body), OK);
    }
    for (int view = 0; view < VIEWS; view++) {
        int shown = (int)(rng_uniform(&rng) * LONG);
        struct skeleton k = frames[shown];
        if (view % 4)
            k = limbs_rotated(&k, 6 * rng_uniform(&rng), 0.02, &rng);
        for (int n = 0; view == VIEWS / 2 && n < LONG; n += 2) {
            frame_selector_exclude(s, n, PART_LEFT_SHIN);
            frame_selector_exclude(alone[n], n, PART_LEFT_SHIN);
        }
        struct frame_selection together[PART_COUNT + 1];
        EXPECT_TRUE(frame_selector_find_parts(s, &k, together) >= OK);
        for (int p = 0; p <= PART_COUNT; p++) { // the last one is the whole body
            struct frame_selection best = {-1, 0}, got = {-1, 0}, one;
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
        frame_selector_close(&alone[n]);
    frame_selector_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_equation_5_is_exact),
        cmocka_unit_test(test_ties_go_to_lowest),
        cmocka_unit_test(test_translation_invariant),
        cmocka_unit_test(test_bad_numbers_are_refused),
        cmocka_unit_test(test_part_selects_visible_side),
        cmocka_unit_test(test_hidden_parts_are_skipped),
        cmocka_unit_test(test_part_selection_matches_exhaustive_search),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
