#include "app/place/robot_place.h"

#include "base/portable_math.h"
#include "locate/locator.h"

#include <stdlib.h>

// Of a panorama TURNS pictures of FIELD radians overlap by a quarter; LEAST_PX: a side. Two agree within APART_M, which
// is more than both maps drift, and APART_RAD. UPRIGHT: cosine of a tilt that no level floor has. Chosen by hand.
enum { MOST_PICTURES = 24, TURNS = 6, FIXES = MOST_PICTURES * TURNS, LEAST_AGREEING = 3, LEAST_PX = 64 };
#define FIELD     1.3
#define APART_M   0.2
#define APART_RAD 0.08
#define UPRIGHT   0.995
#define PI        3.14159265358979323846

struct fix { // of one picture
    struct vec3 in_world, in_place;
    double turn; // of the place's x axis against the world's, to the left
};

static struct lens lens_of(const struct surround_picture *p)
{
    if (!p->panorama)
        return p->lens;
    const double f = p->height / PI; // as many pixels a radian as the panorama has
    const int side = (int)fmax(2 * f * portable_tan(FIELD / 2), LEAST_PX);
    return (struct lens){
        .width = side, .height = side, .fx = f, .fy = f, .cx = (side - 1) / 2.0, .cy = (side - 1) / 2.0};
}

static struct pose turned(const struct surround_picture *p, int turn)
{
    const struct pose about = {quat_from_rotation_vector(v3(0, 2 * PI * turn / TURNS, 0)), v3(0, 0, 0)};
    return pose_multiply(p->world_from_camera, about);
}

static void cut(const struct surround_picture *p, const struct lens *lens, struct pose world_from_cut, uint8_t *rgb)
{
    for (int i = 0; i < lens->width * lens->height; i++) {
        const struct vec3 at =
            pose_apply(world_from_cut, lens_ray(lens, (struct pixel){i % lens->width, i / lens->width}));
        const double world[3] = {at.x, at.y, at.z};
        struct picture_point seen;
        float color[3] = {0, 0, 0};
        if (surround_picture_project(p, world, &seen))
            surround_picture_sample(p, seen.u, seen.v, color);
        for (int c = 0; c < 3; c++)
            rgb[3 * i + c] = (uint8_t)fminf(fmaxf(color[c], 0), 255);
    }
}

static struct vec3 rotated(double turn, struct vec3 v)
{
    const double c = portable_cos(turn), s = portable_sin(turn);
    return v3(c * v.x - s * v.y, s * v.x + c * v.y, 0);
}

static double turn_between(double a, double b) { return portable_atan2(portable_sin(a - b), portable_cos(a - b)); }

static bool agree(const struct fix *a, const struct fix *b)
{
    const struct vec3 there = v3_add(a->in_place, rotated(a->turn, v3_sub(b->in_world, a->in_world)));
    const struct vec3 off = v3_sub(there, b->in_place);
    return fabs(turn_between(a->turn, b->turn)) < APART_RAD && portable_hypot(off.x, off.y) < APART_M;
}

static enum status localize(const struct surround_picture *p, const struct place *place, struct fix *fixes, int *count)
{
    const struct lens lens = lens_of(p);
    struct locator *locator;
    enum status status = locator_open(&locator, place, &lens, NULL);
    uint8_t *rgb = malloc((size_t)lens.width * (size_t)lens.height * 3);
    if (status == OK && !rgb)
        status = fail(ERR_MEMORY, "out of memory");
    for (int turn = 0; turn < (p->panorama ? TURNS : 1) && status >= OK; turn++) {
        const struct pose world_from_cut = turned(p, turn);
        struct location at;
        double m[3][3];
        cut(p, &lens, world_from_cut, rgb);
        status = locator_localize(locator, rgb, NULL, &at);
        if (status != OK)
            continue;
        quat_to_matrix(pose_multiply(at.world_from_camera, pose_inverse(world_from_cut)).rotation, m);
        if (m[2][2] > UPRIGHT)
            fixes[(*count)++] = (struct fix){world_from_cut.translation, at.world_from_camera.translation,
                                             portable_atan2(m[1][0], m[0][0])};
    }
    free(rgb);
    locator_close(&locator);
    return status < OK ? status : OK;
}

// The mean of the fixes that agree with the one with which most do.
static enum status settle(const struct fix *fixes, int count, struct pose *place_from_world)
{
    int best = 0, most = 0;
    for (int i = 0; i < count; i++) {
        int with = 0;
        for (int k = 0; k < count; k++)
            with += agree(&fixes[i], &fixes[k]);
        best = with > most ? i : best;
        most = with > most ? with : most;
    }
    if (most < LEAST_AGREEING)
        return NOTHING;
    double off = 0;
    struct vec3 shift = v3(0, 0, 0);
    for (int k = 0; k < count; k++)
        off += agree(&fixes[best], &fixes[k]) ? turn_between(fixes[k].turn, fixes[best].turn) / most : 0;
    const double turn = fixes[best].turn + off;
    for (int k = 0; k < count; k++)
        if (agree(&fixes[best], &fixes[k]))
            shift = v3_add(shift, v3_scale(v3_sub(fixes[k].in_place, rotated(turn, fixes[k].in_world)), 1.0 / most));
    shift.z = 0;
    *place_from_world = (struct pose){quat_from_rotation_vector(v3(0, 0, turn)), shift};
    return OK;
}

enum status robot_place_find(const struct surround_picture *pictures, int count, const struct place *place,
                             struct pose *place_from_world)
{
    struct fix fixes[FIXES];
    int found = 0;
    enum status status = OK;
    const int step = (count + MOST_PICTURES - 1) / MOST_PICTURES;
    for (int i = 0; i < count && status == OK; i += step)
        if (pictures[i].rgb)
            status = localize(&pictures[i], place, fixes, &found);
    return status == OK ? settle(fixes, found, place_from_world) : status;
}
