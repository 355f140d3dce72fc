#include "capture/mapping/map_internal.h"

#include "locate/relocalization.h"

#include <stdlib.h>

enum status map_place_by_points(struct map *m, int *placed)
{
    struct map_desk *d = malloc(sizeof *d);
    const struct lens *lens = &m->calibration.color;
    *placed = 0;
    if (!d)
        return fail(ERR_MEMORY, "no memory to map natural points");
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        struct fit_tag tags[FIT_MAX_TAGS];
        struct camera_fit fit;
        if (f->placed)
            continue;
        int count = map_fit_tags(m, f, tags), agree[2] = {0, 0};
        if (!count || fit_camera(tags, count, lens->fx, lens->fy, 4, NULL, &fit) != AMBIGUOUS)
            continue;
        struct pose pose[2] = {fit.camera_from_world, fit.other};
        map_lay_out(d, m, f);
        for (int k = 0; k < 2; k++)
            if (!points_refine(m->points, m->point_count, &d->index, d->depth, lens, tags, count, NULL, &pose[k],
                               d->matches, MAP_FEATURES, &agree[k]))
                agree[k] = 0;
        int best = agree[1] > agree[0];
        // Both may lead to the same pose: the search reaches far.
        if (!agree[best] || (2 * agree[best] < 3 * agree[!best] && pose_angle(pose[0], pose[1]) > 0.02))
            continue;
        f->camera_from_world = pose[best];
        f->placed = true;
        ++*placed;
    }
    free(d);
    return OK;
}

// So many points must agree for a frame that no tag vouches for.
enum { LEAST_ALONE = 20 };

// Sharpens `guess` by the points that d's frame shows. False: too few agree.
static bool settle(struct map *m, struct map_desk *d, struct map_frame *f, struct pose guess)
{
    struct fit_tag tags[FIT_MAX_TAGS];
    int count = 0, tag_count = map_fit_tags(m, f, tags);
    if (!points_refine(m->points, m->point_count, &d->index, d->depth, &m->calibration.color, tags, tag_count, NULL,
                       &guess, d->matches, MAP_FEATURES, &count) ||
        count < LEAST_ALONE)
        return false;
    f->camera_from_world = guess;
    f->placed = f->visited = true;
    map_assign(f, d, count);
    map_add_new_points(m, f);
    return true;
}

// From the frame next to it, and as that one came from the one before.
static bool place_beside(struct map *m, struct map_desk *d, int32_t i, int step)
{
    const struct map_frame *near = &m->frames[i - step];
    struct pose guess = near->camera_from_world;
    int32_t before = i - 2 * step;
    if (before >= 0 && before < m->frame_count && m->frames[before].placed)
        guess = pose_multiply(pose_multiply(guess, pose_inverse(m->frames[before].camera_from_world)), guess);
    map_lay_out(d, m, &m->frames[i]);
    return settle(m, d, &m->frames[i], guess) || settle(m, d, &m->frames[i], near->camera_from_world);
}

static bool place_anywhere(struct map *m, struct map_desk *d, struct map_frame *f)
{
    struct pose guess;
    int agree;
    map_lay_out(d, m, f);
    int count = relocate_match(m->points, m->point_count, &d->index, d->matches, MAP_FEATURES);
    return relocate(m->points, &d->index, &m->calibration.color, d->matches, count, NULL, &guess, &agree) &&
           settle(m, d, f, guess);
}

// Errors grow from frame to frame; before they are larger than the search for points
// reaches, everything is adjusted, so that a way round closes.
enum { ADJUST_EVERY = 20, ADJUST_ROUNDS = 6 };

static enum status count_in(struct map *m, int *placed)
{
    return ++*placed % ADJUST_EVERY == 0 ? map_adjust(m, ADJUST_ROUNDS, false, NULL) : OK;
}

static enum status sweep(struct map *m, struct map_desk *d, int step, int *placed)
{
    enum status status = OK;
    for (int32_t n = 1; n < m->frame_count && status == OK; n++) {
        int32_t i = step > 0 ? n : m->frame_count - 1 - n;
        if (!m->frames[i].placed && m->frames[i - step].placed && place_beside(m, d, i, step))
            status = count_in(m, placed);
    }
    return status;
}

enum status map_follow(struct map *m, int *placed)
{
    struct map_desk *d = malloc(sizeof *d);
    enum status status = OK;
    int before;
    *placed = 0;
    if (!d)
        return fail(ERR_MEMORY, "no memory to map natural points");
    do {
        before = *placed;
        status = sweep(m, d, 1, placed);
        if (status == OK)
            status = sweep(m, d, -1, placed);
        for (int32_t i = 0; i < m->frame_count && status == OK && *placed == before; i++)
            if (!m->frames[i].placed && place_anywhere(m, d, &m->frames[i]))
                status = count_in(m, placed);
    } while (status == OK && *placed > before);
    free(d);
    return status;
}

enum status map_start_by_points(struct map *m)
{
    int most = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        int count = 0;
        for (int32_t k = 0; k < m->frames[i].feature_count; k++)
            count += m->frames[i].features[k].depth > 0;
        if (count > most) {
            most = count;
            m->held_frame = i;
        }
    }
    if (most < LEAST_ALONE)
        return fail(ERR_INPUT, "no picture shows enough that can be recognised and has depth; film a place with "
                               "things in it, in good light, or hang tags and list them");
    struct map_frame *f = &m->frames[m->held_frame];
    f->placed = f->visited = true;
    f->camera_from_world = POSE_IDENTITY;
    map_add_new_points(m, f);
    return OK;
}
