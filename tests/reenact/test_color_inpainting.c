// What nobody saw of a person is coloured as clothes are: alike all round, without the front's print, and as the body's
// other half where that was seen. A trunk, two arms and a head of dark hair, seen from before only.
#include "tests/support/test.h"

#include "reenact/avatar/color_inpainting.h"

#include <stdlib.h>
#include <string.h>

enum { AROUND = 80, ALONG = 60, PIECE = AROUND * ALONG, TRUNK = 0, HEAD = PIECE, ARMS = 2 * PIECE, POINTS = 4 * PIECE };
static const double PI = 3.14159265358979323846;
static const float red[3] = {0.5F, 0.02F, 0.02F}, black[3] = {0.02F, 0.02F, 0.02F}, white[3] = {0.8F, 0.8F, 0.8F},
                   skin[3] = {0.6F, 0.35F, 0.25F}, hair[3] = {0.03F, 0.02F, 0.02F}, wrong[3] = {0.1F, 0.2F, 0.8F},
                   nothing[3] = {0, 1, 0};

struct person {
    struct rest rest;
    struct surface surface;
    struct skin skins[POINTS];
    struct coat coat;
    const float *truth[POINTS];
    float told[POINTS][3]; // what coat_fill is given
};

enum { SPECK = 7 }; // of so many points one was seen wrongly, as at edges

static struct part_frame frame_along(struct vec3 from, double length)
{
    return (struct part_frame){from, v3(1, 0, 0), v3(0, 0, -1), v3(0, 1, 0), length}; // hanging; y is the front
}

// A point of the surface, of a colour that coat_fill is told only if it was seen.
static void put(struct person *p, int at, int bone, struct vec3 point, const float *color, bool seen)
{
    p->surface.points[at] = point;
    p->skins[at] = (struct skin){{(uint8_t)bone}, {1}};
    p->truth[at] = color;
    memcpy(p->told[at], !seen ? nothing : at % SPECK || at >= ARMS ? color : wrong, sizeof p->told[at]);
    memcpy(p->coat.color[at], p->told[at], sizeof p->told[at]);
    p->coat.time_s[at] = seen ? 1.5F : 0;
    p->coat.filled[at] = !seen;
}

static void put_trunk(struct person *p)
{
    for (int i = 0; i < PIECE; i++) {
        const double angle = 2 * PI * (i % AROUND) / AROUND, down = 0.5 * (i / AROUND) / ALONG;
        const struct vec3 at = {0.17 * sin(angle), down, -0.12 * cos(angle)};
        const bool print = fabs(at.x) < 0.06 && at.z < 0 && down > 0.12 && down < 0.22; // a third of what is seen there
        put(p, TRUNK + i, PART_UPPER_TORSO, at, print ? white : down < 0.3 ? red : black, at.z < 0.02);
    }
}

static void put_head(struct person *p)
{
    const struct vec3 middle = p->rest.frame[BONE_SKULL].origin;
    for (int i = 0; i < PIECE; i++) {
        const double angle = 2 * PI * (i % AROUND) / AROUND, up = PI * (i / AROUND + 0.5) / ALONG;
        const struct vec3 out = {sin(up) * sin(angle), -cos(up), -sin(up) * cos(angle)};
        const bool face = out.z < -0.1 && out.y > -0.5;
        put(p, HEAD + i, BONE_SKULL, v3_add(middle, v3_scale(out, 0.1)), face ? skin : hair, out.z < 0.2);
    }
}

// Sleeves of two colours; of one arm the outer side was seen as well, of the other only the front.
static void put_arms(struct person *p)
{
    for (int i = 0; i < 2 * PIECE; i++) {
        const int side = i / PIECE ? 1 : -1, k = i % PIECE;
        const double angle = 2 * PI * (k % AROUND) / AROUND, down = 0.3 * (k / AROUND) / ALONG;
        const double out = 0.05 * sin(angle), front = -0.05 * cos(angle);
        const bool stripe = out > 0.035;
        put(p, ARMS + i, side > 0 ? PART_LEFT_UPPER_ARM : PART_RIGHT_UPPER_ARM, v3(side * (0.3 + out), down, front),
            stripe ? white : red, side > 0 || (front < 0 && !stripe));
    }
}

static struct person *person_make(void)
{
    struct person *p = calloc(1, sizeof *p);
    p->rest.frame[PART_UPPER_TORSO] = frame_along(v3(0, 0, 0), 0.5);
    p->rest.frame[PART_LEFT_UPPER_ARM] = frame_along(v3(0.3, 0, 0), 0.3);
    p->rest.frame[PART_RIGHT_UPPER_ARM] = frame_along(v3(-0.3, 0, 0), 0.3);
    p->rest.frame[BONE_SKULL] = frame_along(v3(0, -0.3, 0), 0.1);
    p->surface.points = calloc(POINTS, sizeof *p->surface.points);
    p->surface.point_count = POINTS;
    p->coat.color = calloc(POINTS, sizeof *p->coat.color);
    p->coat.time_s = calloc(POINTS, sizeof *p->coat.time_s);
    p->coat.filled = calloc(POINTS, 1);
    put_trunk(p);
    put_head(p);
    put_arms(p);
    return p;
}

static void person_free(struct person *p)
{
    surface_free(&p->surface);
    coat_free(&p->coat);
    free(p);
}

static float off_from(const struct person *p, int at, const float color[3])
{
    float most = 0;
    for (int c = 0; c < 3; c++)
        most = fmaxf(most, fabsf(sqrtf(p->coat.color[at][c]) - sqrtf(color[c])));
    return most;
}

static int by_value(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// How far the made up colours of a piece are from the truth's, of 0 to 1, at worst: but for `share` of them.
static float worst_but(const struct person *p, int piece, double share)
{
    static float off[PIECE];
    int count = 0;
    for (int i = piece; i < piece + PIECE; i++)
        if (p->coat.filled[i])
            off[count++] = off_from(p, i, p->truth[i]);
    assert_true(count > 0);
    qsort(off, (size_t)count, sizeof *off, by_value);
    print_message("%d filled, median off %.3f, at %.0f %% %.3f\n", count, (double)off[count / 2], 100 * (1 - share),
                  (double)off[(int)((count - 1) * (1 - share))]);
    return off[(int)((count - 1) * (1 - share))];
}

static struct person *filled_person(void)
{
    struct person *p = person_make();
    EXPECT_STATUS(coat_fill(&p->coat, &p->surface, p->skins, &p->rest), OK);
    return p;
}

// Red above, black below, and no print; where one ends and the other begins it may be either.
static void a_back_is_as_the_front_without_its_print(void **state)
{
    (void)state;
    struct person *p = filled_person();
    EXPECT_AT_MOST(worst_but(p, TRUNK, 0.06), 0.05);
    person_free(p);
}

static void a_head_has_its_face_before(void **state)
{
    (void)state;
    struct person *p = filled_person();
    EXPECT_AT_MOST(worst_but(p, HEAD, 0.02), 0.05);
    person_free(p);
}

// The right arm's stripe is nowhere to be seen but on the left one.
static void one_arm_is_as_the_other(void **state)
{
    (void)state;
    struct person *p = filled_person();
    EXPECT_AT_MOST(worst_but(p, ARMS, 0), 0.01);
    person_free(p);
}

static void what_was_seen_stays(void **state)
{
    (void)state;
    struct person *p = filled_person();
    for (int i = 0; i < POINTS; i++)
        if (!p->coat.filled[i])
            EXPECT_AT_MOST(off_from(p, i, p->told[i]), 0);
    person_free(p);
}

// Of a part nothing of which was seen its neighbour tells; of a person nothing of whom was, nobody.
static void a_part_nobody_saw(void **state)
{
    (void)state;
    struct person *p = person_make();
    memset(p->coat.filled + HEAD, 1, PIECE);
    EXPECT_STATUS(coat_fill(&p->coat, &p->surface, p->skins, &p->rest), OK);
    float green = 0;
    for (int i = HEAD; i < HEAD + PIECE; i++)
        green = fmaxf(green, p->coat.color[i][1]);
    EXPECT_AT_MOST(green, 0.25); // as the nearest of the trunk, not the 1 that it was
    memset(p->coat.filled, 1, POINTS);
    EXPECT_STATUS(coat_fill(&p->coat, &p->surface, p->skins, &p->rest), OK);
    person_free(p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_back_is_as_the_front_without_its_print),
        cmocka_unit_test(a_head_has_its_face_before),
        cmocka_unit_test(one_arm_is_as_the_other),
        cmocka_unit_test(what_was_seen_stays),
        cmocka_unit_test(a_part_nobody_saw),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
