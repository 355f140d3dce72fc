#include "app/place/robot_place.h"

#include "base/portable_math.h"
#include "base/threads.h"
#include "locate/locator.h"

#include <stdio.h>
#include <stdlib.h>

static enum status robot_place_open(struct robot_place **out, const struct place *place);
static void robot_place_close(struct robot_place **r);
static enum status robot_place_look(struct robot_place *place, const struct surround_picture *picture);
static enum status robot_place_settle(const struct robot_place *place, struct pose *place_from_world);

// ---------------------------------------------------------------- robot place finder

// Once found, one of so many captures is looked at. Chosen by hand: they come about every half metre, and the robot's
// own world drifts by millimetres in that.
enum { SELDOM = 8 };

struct robot_place_finder {
    struct robot_place *place; // the thread's
    int offered;               // captures there were when one was put last
    struct worker_thread worker;

    // Under its lock, which is never held while a picture is looked at:
    struct surround_picture picture; // to be looked at
    bool pending;
    struct robot_place_answer answer;
};

static void note_result(struct robot_place_finder *finder, enum status status, struct pose place_from_world)
{
    struct robot_place_answer *a = &finder->answer;
    a->looked++;
    if (status == OK) {
        a->state = ROBOT_PLACE_FOUND;
        a->place_from_world = place_from_world;
    } else if (a->state != ROBOT_PLACE_FOUND) { // once found it is kept
        a->state = status == NOTHING ? ROBOT_PLACE_TOO_LITTLE : ROBOT_PLACE_FAILED;
        snprintf(a->trouble, sizeof a->trouble, "%s", status == NOTHING ? "" : status_message());
    }
}

static void *run_finder(void *self)
{
    struct robot_place_finder *f = self;
    thread_lower_priority();
    pthread_mutex_lock(&f->worker.lock);
    while (!f->worker.closing) {
        if (!f->pending) {
            pthread_cond_wait(&f->worker.changed, &f->worker.lock);
            continue;
        }
        const struct surround_picture picture = f->picture;
        pthread_mutex_unlock(&f->worker.lock);
        struct pose place_from_world = POSE_IDENTITY;
        enum status status = robot_place_look(f->place, &picture);
        if (status == OK || status == ERR_SOLVER) // a solver that failed did so on this picture only
            status = robot_place_settle(f->place, &place_from_world);
        pthread_mutex_lock(&f->worker.lock);
        note_result(f, status, place_from_world);
        f->pending = false;
    }
    pthread_mutex_unlock(&f->worker.lock);
    return NULL;
}

enum status robot_place_finder_start(struct robot_place_finder **out, const struct place *place)
{
    struct robot_place_finder *f = *out = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "no memory for finding the robot's place");
    worker_thread_open(&f->worker);
    enum status status = robot_place_open(&f->place, place);
    if (status == OK)
        status = worker_thread_start(&f->worker, run_finder, f, "to look for the robot in its place");
    if (status != OK)
        robot_place_finder_close(out);
    return status;
}

void robot_place_finder_close(struct robot_place_finder **out)
{
    struct robot_place_finder *f = *out;
    if (!f)
        return;
    worker_thread_close(&f->worker);
    robot_place_close(&f->place);
    free(f);
    *out = NULL;
}

void robot_place_finder_update(struct robot_place_finder *finder, const struct surround_picture *pictures, int count,
                               struct robot_place_answer *out)
{
    pthread_mutex_lock(&finder->worker.lock);
    const enum robot_place_state state = finder->answer.state;
    const int due = finder->offered + (state == ROBOT_PLACE_FOUND ? SELDOM : 1);
    if (!finder->pending && state != ROBOT_PLACE_FAILED && count >= due) {
        finder->picture = pictures[count - 1];
        finder->pending = true;
        finder->offered = count;
        pthread_cond_signal(&finder->worker.changed);
    }
    *out = finder->answer;
    pthread_mutex_unlock(&finder->worker.lock);
}

// ---------------------------------------------------------------- robot place

// Of a panorama TURNS pictures of FIELD radians overlap by a quarter; MIN_PX: a side. Two agree within APART_M, which
// is more than both maps drift, and APART_RAD. UPRIGHT: cosine of a tilt that no level floor has. Chosen by hand.
enum { MAX_PICTURES = 24, TURNS = 6, FIXES = MAX_PICTURES * TURNS, MIN_AGREEING = 3, MIN_PX = 64 };
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

static struct lens lens_of(const struct surround_picture *picture)
{
    if (!picture->panorama)
        return picture->lens;
    const double f = picture->height / PI; // as many pixels a radian as the panorama has
    const int side = (int)fmax(2 * f * portable_tan(FIELD / 2), MIN_PX);
    return (struct lens){
        .width = side, .height = side, .fx = f, .fy = f, .cx = (side - 1) / 2.0, .cy = (side - 1) / 2.0};
}

static struct pose turned_pose(const struct surround_picture *picture, int turn)
{
    const struct pose about = {quat_from_rotation_vector(v3(0, 2 * PI * turn / TURNS, 0)), v3(0, 0, 0)};
    return pose_multiply(picture->world_from_camera, about);
}

static void resample_view(const struct surround_picture *picture, const struct lens *lens, struct pose world_from_cut,
                          uint8_t *rgb)
{
    for (int i = 0; i < lens->width * lens->height; i++) {
        const struct vec3 at =
            pose_apply(world_from_cut, lens_ray(lens, (struct pixel){i % lens->width, i / lens->width}));
        const double world[3] = {at.x, at.y, at.z};
        struct picture_point seen;
        float color[3] = {0, 0, 0};
        if (surround_picture_project(picture, world, &seen))
            surround_picture_sample(picture, seen.u, seen.v, color);
        for (int c = 0; c < 3; c++)
            rgb[3 * i + c] = (uint8_t)fminf(fmaxf(color[c], 0), 255);
    }
}

static struct vec3 rotate_about_z(double turn, struct vec3 v)
{
    const double c = portable_cos(turn), s = portable_sin(turn);
    return v3(c * v.x - s * v.y, s * v.x + c * v.y, 0);
}

static double turn_between(double a, double b) { return portable_atan2(portable_sin(a - b), portable_cos(a - b)); }

static bool are_fixes_consistent(const struct fix *a, const struct fix *b)
{
    const struct vec3 there = v3_add(a->in_place, rotate_about_z(a->turn, v3_sub(b->in_world, a->in_world)));
    const struct vec3 off = v3_sub(there, b->in_place);
    return fabs(turn_between(a->turn, b->turn)) < APART_RAD && portable_hypot(off.x, off.y) < APART_M;
}

// Borrows the place. ERR_MEMORY; *out is then NULL.
static enum status robot_place_open(struct robot_place **out, const struct place *place)
{
    struct robot_place *r = *out = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory for the robot's place");
    r->place = place;
    return OK;
}

// NULL is fine
static void robot_place_close(struct robot_place **out)
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
static enum status fit_locator(struct robot_place *place, const struct lens *lens)
{
    if (place->locator && lens_equal(&place->lens, lens))
        return OK;
    locator_close(&place->locator);
    free(place->rgb);
    place->lens = *lens;
    place->rgb = malloc((size_t)lens->width * (size_t)lens->height * 3);
    return place->rgb ? locator_open(&place->locator, place->place, lens, NULL)
                      : fail(ERR_MEMORY, "no memory for the robot's place");
}

static void add_fix(struct robot_place *place, struct pose world_from_cut, struct pose place_from_cut)
{
    double m[3][3];
    quat_to_matrix(pose_multiply(place_from_cut, pose_inverse(world_from_cut)).rotation, m);
    if (!(m[2][2] > UPRIGHT))
        return;
    place->fixes[place->next] =
        (struct fix){world_from_cut.translation, place_from_cut.translation, portable_atan2(m[1][0], m[0][0])};
    place->next = (place->next + 1) % FIXES;
    place->count += place->count < FIXES;
}

// Localises what one picture shows: of a panorama six cuts, some tenths of a second. Of the newest two dozen panoramas
// is kept where they are. ERR_INPUT, ERR_MEMORY, ERR_SOLVER: as locator_open and locator_localize.
static enum status robot_place_look(struct robot_place *place, const struct surround_picture *picture)
{
    const struct lens lens = lens_of(picture);
    enum status status = fit_locator(place, &lens);
    for (int turn = 0; turn < (picture->panorama ? TURNS : 1) && status >= OK; turn++) {
        const struct pose world_from_cut = turned_pose(picture, turn);
        struct location at;
        resample_view(picture, &lens, world_from_cut, place->rgb);
        status = locator_localize(place->locator, place->rgb, NULL, &at);
        if (status == OK)
            add_fix(place, world_from_cut, at.world_from_camera);
    }
    return status < OK ? status : OK;
}

// The mean of the fixes that agree with the one with which most do.
// From all pictures looked at. NOTHING: fewer than three cuts agree; *place_from_world is then untouched.
static enum status robot_place_settle(const struct robot_place *place, struct pose *place_from_world)
{
    const struct fix *fixes = place->fixes;
    int best = 0, max = 0;
    for (int i = 0; i < place->count; i++) {
        int with = 0;
        for (int k = 0; k < place->count; k++)
            with += are_fixes_consistent(&fixes[i], &fixes[k]);
        best = with > max ? i : best;
        max = with > max ? with : max;
    }
    if (max < MIN_AGREEING)
        return NOTHING;
    double off = 0;
    struct vec3 shift = v3(0, 0, 0);
    for (int k = 0; k < place->count; k++)
        off += are_fixes_consistent(&fixes[best], &fixes[k]) ? turn_between(fixes[k].turn, fixes[best].turn) / max : 0;
    const double turn = fixes[best].turn + off;
    for (int k = 0; k < place->count; k++)
        if (are_fixes_consistent(&fixes[best], &fixes[k]))
            shift =
                v3_add(shift, v3_scale(v3_sub(fixes[k].in_place, rotate_about_z(turn, fixes[k].in_world)), 1.0 / max));
    shift.z = 0;
    *place_from_world = (struct pose){quat_from_rotation_vector(v3(0, 0, turn)), shift};
    return OK;
}

enum status robot_place_find(const struct surround_picture *pictures, int count, const struct place *place,
                             struct pose *place_from_world)
{
    struct robot_place *r;
    enum status status = robot_place_open(&r, place);
    const int step = (count + MAX_PICTURES - 1) / MAX_PICTURES;
    for (int i = 0; i < count && status == OK; i += step)
        if (pictures[i].rgb)
            status = robot_place_look(r, &pictures[i]);
    if (status == OK)
        status = robot_place_settle(r, place_from_world);
    robot_place_close(&r);
    return status;
}
