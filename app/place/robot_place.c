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

struct robot_place {
    const struct place *place;
    struct locator *locator; // of the cuts' lens; NULL: not opened yet
    struct lens lens;
    uint8_t *rgb; // of a cut
    struct fix fixes[FIXES];
    int count, next; // of them; where the next is put, the oldest goes first
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

enum status robot_place_open(struct robot_place **out, const struct place *place)
{
    struct robot_place *r = *out = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "out of memory");
    r->place = place;
    return OK;
}

void robot_place_close(struct robot_place **out)
{
    struct robot_place *r = *out;
    if (!r)
        return;
    locator_close(&r->locator);
    free(r->rgb);
    free(r);
    *out = NULL;
}

// The locator of the cuts of such a picture.
static enum status fit_locator(struct robot_place *r, const struct lens *lens)
{
    if (r->locator && lens_equal(&r->lens, lens))
        return OK;
    locator_close(&r->locator);
    free(r->rgb);
    r->lens = *lens;
    r->rgb = malloc((size_t)lens->width * (size_t)lens->height * 3);
    return r->rgb ? locator_open(&r->locator, r->place, lens, NULL) : fail(ERR_MEMORY, "out of memory");
}

static void add_fix(struct robot_place *r, struct pose world_from_cut, struct pose place_from_cut)
{
    double m[3][3];
    quat_to_matrix(pose_multiply(place_from_cut, pose_inverse(world_from_cut)).rotation, m);
    if (!(m[2][2] > UPRIGHT))
        return;
    r->fixes[r->next] =
        (struct fix){world_from_cut.translation, place_from_cut.translation, portable_atan2(m[1][0], m[0][0])};
    r->next = (r->next + 1) % FIXES;
    r->count += r->count < FIXES;
}

enum status robot_place_look(struct robot_place *r, const struct surround_picture *picture)
{
    const struct lens lens = lens_of(picture);
    enum status status = fit_locator(r, &lens);
    for (int turn = 0; turn < (picture->panorama ? TURNS : 1) && status >= OK; turn++) {
        const struct pose world_from_cut = turned(picture, turn);
        struct location at;
        cut(picture, &lens, world_from_cut, r->rgb);
        status = locator_localize(r->locator, r->rgb, NULL, &at);
        if (status == OK)
            add_fix(r, world_from_cut, at.world_from_camera);
    }
    return status < OK ? status : OK;
}

// The mean of the fixes that agree with the one with which most do.
enum status robot_place_settle(const struct robot_place *r, struct pose *place_from_world)
{
    const struct fix *fixes = r->fixes;
    int best = 0, most = 0;
    for (int i = 0; i < r->count; i++) {
        int with = 0;
        for (int k = 0; k < r->count; k++)
            with += agree(&fixes[i], &fixes[k]);
        best = with > most ? i : best;
        most = with > most ? with : most;
    }
    if (most < LEAST_AGREEING)
        return NOTHING;
    double off = 0;
    struct vec3 shift = v3(0, 0, 0);
    for (int k = 0; k < r->count; k++)
        off += agree(&fixes[best], &fixes[k]) ? turn_between(fixes[k].turn, fixes[best].turn) / most : 0;
    const double turn = fixes[best].turn + off;
    for (int k = 0; k < r->count; k++)
        if (agree(&fixes[best], &fixes[k]))
            shift = v3_add(shift, v3_scale(v3_sub(fixes[k].in_place, rotated(turn, fixes[k].in_world)), 1.0 / most));
    shift.z = 0;
    *place_from_world = (struct pose){quat_from_rotation_vector(v3(0, 0, turn)), shift};
    return OK;
}

enum status robot_place_find(const struct surround_picture *pictures, int count, const struct place *place,
                             struct pose *place_from_world)
{
    struct robot_place *r;
    enum status status = robot_place_open(&r, place);
    const int step = (count + MOST_PICTURES - 1) / MOST_PICTURES;
    for (int i = 0; i < count && status == OK; i += step)
        if (pictures[i].rgb)
            status = robot_place_look(r, &pictures[i]);
    if (status == OK)
        status = robot_place_settle(r, place_from_world);
    robot_place_close(&r);
    return status;
}
