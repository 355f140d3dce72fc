// Colour inpainting of what was never seen of a person: as clothes are, alike all round without the front's print, and
// as the body's other half where that was seen. A trunk, two arms and a head of dark hair, seen from the front only.
#include "tests/support/test.h"

#include "reenact/avatar/texture_atlas.h"

#include <stdlib.h>
#include <string.h>

enum { AROUND = 80, ALONG = 60, PIECE = AROUND * ALONG, TRUNK = 0, HEAD = PIECE, ARMS = 2 * PIECE, POINTS = 4 * PIECE };
static const double PI = 3.14159265358979323846;
static const float red[3] = {0.5F, 0.02F, 0.02F}, black[3] = {0.02F, 0.02F, 0.02F}, white[3] = {0.8F, 0.8F, 0.8F},
                   skin[3] = {0.6F, 0.35F, 0.25F}, hair[3] = {0.03F, 0.02F, 0.02F}, wrong[3] = {0.1F, 0.2F, 0.8F},
                   nothing[3] = {0, 1, 0};

struct person {
    struct bind_pose bind;
    struct surface_mesh surface;
    struct skin_weights skins[POINTS];
    struct vertex_colors vertex_colors;
    const float *truth[POINTS];
    float given[POINTS][3]; // the input of color_inpaint
};

enum { SPECK = 7 }; // one point in so many has a wrong colour, as at edges

static struct bone_frame frame_along(struct vec3 from, double length)
{
    return (struct bone_frame){from, v3(1, 0, 0), v3(0, 0, -1), v3(0, 1, 0), length}; // vertical; y is the front
}

// Sets a point of the surface; color_inpaint gets its colour only if it was seen.
static void put(struct person *p, int at, int bone, struct vec3 point, const float *color, bool seen)
{
    p->surface.points[at] = point;
    p->skins[at] = (struct skin_weights){{(uint8_t)bone}, {1}};
    p->truth[at] = color;
    memcpy(p->given[at], !seen ? nothing : at % SPECK || at >= ARMS ? color : wrong, sizeof p->given[at]);
    memcpy(p->vertex_colors.color[at], p->given[at], sizeof p->given[at]);
    p->vertex_colors.time_s[at] = seen ? 1.5F : 0;
    p->vertex_colors.filled[at] = !seen;
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
    const struct vec3 center = p->bind.frame[BONE_SKULL].origin;
    for (int i = 0; i < PIECE; i++) {
        const double angle = 2 * PI * (i % AROUND) / AROUND, up = PI * (i / AROUND + 0.5) / ALONG;
        const struct vec3 out = {sin(up) * sin(angle), -cos(up), -sin(up) * cos(angle)};
        const bool face = out.z < -0.1 && out.y > -0.5;
        put(p, HEAD + i, BONE_SKULL, v3_add(center, v3_scale(out, 0.1)), face ? skin : hair, out.z < 0.2);
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
    p->bind.frame[PART_UPPER_TORSO] = frame_along(v3(0, 0, 0), 0.5);
    p->bind.frame[PART_LEFT_UPPER_ARM] = frame_along(v3(0.3, 0, 0), 0.3);
    p->bind.frame[PART_RIGHT_UPPER_ARM] = frame_along(v3(-0.3, 0, 0), 0.3);
    p->bind.frame[BONE_SKULL] = frame_along(v3(0, -0.3, 0), 0.1);
    p->surface.points = calloc(POINTS, sizeof *p->surface.points);
    p->surface.point_count = POINTS;
    p->vertex_colors.color = calloc(POINTS, sizeof *p->vertex_colors.color);
    p->vertex_colors.time_s = calloc(POINTS, sizeof *p->vertex_colors.time_s);
    p->vertex_colors.filled = calloc(POINTS, 1);
    put_trunk(p);
    put_head(p);
    put_arms(p);
    return p;
}

static void person_free(struct person *p)
{
    surface_mesh_free(&p->surface);
    vertex_colors_free(&p->vertex_colors);
    free(p);
}

static float off_from(const struct person *p, int at, const float color[3])
{
    float most = 0;
    for (int c = 0; c < 3; c++)
        most = fmaxf(most, fabsf(sqrtf(p->vertex_colors.color[at][c]) - sqrtf(color[c])));
    return most;
}

static int by_value(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// The largest error of a piece's inpainted colours, gamma-encoded, 0 to 1, without the worst `share` of them.
static float worst_without(const struct person *p, int piece, double share)
{
    static float off[PIECE];
    int count = 0;
    for (int i = piece; i < piece + PIECE; i++)
        if (p->vertex_colors.filled[i])
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
    EXPECT_STATUS(color_inpaint(&p->vertex_colors, &(struct vertex_color_target){&p->bind, &p->surface, p->skins}, 2),
                  OK);
    return p;
}

// Red above, black below, and no print; at the border both are right.
static void test_back_copies_front_without_print(void **state)
{
    (void)state;
    struct person *p = filled_person();
    EXPECT_AT_MOST(worst_without(p, TRUNK, 0.06), 0.01);
    person_free(p);
}

static void test_head_has_face_in_front(void **state)
{
    (void)state;
    struct person *p = filled_person();
    EXPECT_AT_MOST(worst_without(p, HEAD, 0.02), 0.01);
    person_free(p);
}

// The right arm's stripe was seen on the left arm only.
static void test_arm_copies_other_arm(void **state)
{
    (void)state;
    struct person *p = filled_person();
    EXPECT_AT_MOST(worst_without(p, ARMS, 0), 0.001);
    person_free(p);
}

static void test_seen_colors_are_kept(void **state)
{
    (void)state;
    struct person *p = filled_person();
    for (int i = 0; i < POINTS; i++)
        if (!p->vertex_colors.filled[i])
            EXPECT_AT_MOST(off_from(p, i, p->given[i]), 0);
    person_free(p);
}

// A part that was not seen at all takes its neighbour's colour; a person that was not seen at all is left alone.
static void test_unseen_part(void **state)
{
    (void)state;
    struct person *p = person_make();
    memset(p->vertex_colors.filled + HEAD, 1, PIECE);
    EXPECT_STATUS(color_inpaint(&p->vertex_colors, &(struct vertex_color_target){&p->bind, &p->surface, p->skins}, 2),
                  OK);
    float green = 0;
    for (int i = HEAD; i < HEAD + PIECE; i++)
        green = fmaxf(green, p->vertex_colors.color[i][1]);
    EXPECT_AT_MOST(green, 0.25); // of the nearest trunk points, instead of its initial 1
    memset(p->vertex_colors.filled, 1, POINTS);
    EXPECT_STATUS(color_inpaint(&p->vertex_colors, &(struct vertex_color_target){&p->bind, &p->surface, p->skins}, 2),
                  OK);
    person_free(p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_back_copies_front_without_print),
        cmocka_unit_test(test_head_has_face_in_front),
        cmocka_unit_test(test_arm_copies_other_arm),
        cmocka_unit_test(test_seen_colors_are_kept),
        cmocka_unit_test(test_unseen_part),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
