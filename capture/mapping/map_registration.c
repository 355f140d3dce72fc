// Registration of frames by the landmarks they show.
#include "capture/mapping/map_internal.h"

#include "locate/relocalization.h"

#include <stdlib.h>

enum status map_resolve_ambiguous_poses(struct map *m, int *placed)
{
    struct map_scratch *d = malloc(sizeof *d);
    const struct lens *lens = &m->calibration.color;
    *placed = 0;
    if (!d)
        return fail(ERR_MEMORY, "no memory to map landmarks");
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        struct pnp_tag tags[PNP_MAX_TAGS];
        struct pnp_solution fit;
        if (f->placed)
            continue;
        int count = map_tag_correspondences(m, f, tags), agree[2] = {0, 0};
        const struct pose_problem problem = {.tags = tags, .tag_count = count, .fx = lens->fx, .fy = lens->fy};
        if (!count || pnp_solve(&problem, 4, &fit) != AMBIGUOUS)
            continue;
        struct pose pose[2] = {fit.camera_from_world, fit.other};
        map_index_features(d, m, f);
        const struct match_query query = map_match_query(m, d, tags, count);
        for (int k = 0; k < 2; k++)
            if (!landmarks_refine_pose(&query, NULL, &pose[k], d->matches, MAP_MAX_FEATURES, &agree[k]))
                agree[k] = 0;
        int best = agree[1] > agree[0];
        // Both may have converged to the same pose, because the search radius is wide.
        if (!agree[best] || (2 * agree[best] < 3 * agree[!best] && pose_angle(pose[0], pose[1]) > 0.02))
            continue;
        f->camera_from_world = pose[best];
        f->placed = true;
        ++*placed;
    }
    free(d);
    return OK;
}

// Landmark inliers that a frame without a tag needs. Chosen by hand.
enum { MIN_INLIERS = 20 };

// Refines `guess` by the landmarks that d's frame shows, and places the frame there. False: too few inliers.
static bool refine_and_register(struct map *m, struct map_scratch *d, struct map_frame *f, struct pose guess)
{
    struct pnp_tag tags[PNP_MAX_TAGS];
    int count = 0, tag_count = map_tag_correspondences(m, f, tags);
    const struct match_query query = map_match_query(m, d, tags, tag_count);
    if (!landmarks_refine_pose(&query, NULL, &guess, d->matches, MAP_MAX_FEATURES, &count) || count < MIN_INLIERS)
        return false;
    f->camera_from_world = guess;
    f->placed = f->visited = true;
    map_assign_matches(f, d, count);
    map_create_landmarks(m, f);
    return true;
}

// First guess: the neighbour's pose, moved on as the neighbour was from the frame before it. Second: without motion.
static bool register_from_neighbour(struct map *m, struct map_scratch *d, int32_t i, int step)
{
    const struct map_frame *neighbour = &m->frames[i - step];
    struct pose guess = neighbour->camera_from_world;
    int32_t before = i - 2 * step;
    if (before >= 0 && before < m->frame_count && m->frames[before].placed)
        guess = pose_multiply(pose_multiply(guess, pose_inverse(m->frames[before].camera_from_world)), guess);
    map_index_features(d, m, &m->frames[i]);
    return refine_and_register(m, d, &m->frames[i], guess) ||
           refine_and_register(m, d, &m->frames[i], neighbour->camera_from_world);
}

static bool relocalize_frame(struct map *m, struct map_scratch *d, struct map_frame *f)
{
    struct pose guess;
    int agree;
    map_index_features(d, m, f);
    const struct match_query query = map_match_query(m, d, NULL, 0);
    int count = relocalize_match(&query, d->matches, MAP_MAX_FEATURES);
    return relocalize(&query, d->matches, count, NULL, &guess, &agree) && refine_and_register(m, d, f, guess);
}

// Drift grows from frame to frame. Everything is adjusted before it exceeds the search radius of landmark matching, so
// that loops can close. Chosen by hand.
enum { ADJUST_EVERY = 20, ADJUST_ROUNDS = 6 };

static enum status count_placed(struct map *m, int *placed)
{
    return ++*placed % ADJUST_EVERY == 0 ? map_bundle_adjust(m, ADJUST_ROUNDS, false, NULL) : OK;
}

static enum status register_pass(struct map *m, struct map_scratch *d, int step, int *placed)
{
    enum status status = OK;
    for (int32_t n = 1; n < m->frame_count && status == OK; n++) {
        int32_t i = step > 0 ? n : m->frame_count - 1 - n;
        if (!m->frames[i].placed && m->frames[i - step].placed && register_from_neighbour(m, d, i, step))
            status = count_placed(m, placed);
    }
    return status;
}

enum status map_register_frames(struct map *m, int *placed)
{
    struct map_scratch *d = malloc(sizeof *d);
    enum status status = OK;
    int before;
    *placed = 0;
    if (!d)
        return fail(ERR_MEMORY, "no memory to map landmarks");
    do {
        before = *placed;
        status = register_pass(m, d, 1, placed);
        if (status == OK)
            status = register_pass(m, d, -1, placed);
        for (int32_t i = 0; i < m->frame_count && status == OK && *placed == before; i++)
            if (!m->frames[i].placed && relocalize_frame(m, d, &m->frames[i]))
                status = count_placed(m, placed);
    } while (status == OK && *placed > before);
    free(d);
    return status;
}

enum status map_init_from_depth(struct map *m)
{
    int most = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        int count = 0;
        for (int32_t k = 0; k < m->frames[i].feature_count; k++)
            count += m->frames[i].features[k].depth > 0;
        if (count > most) {
            most = count;
            m->fixed_frame = i;
        }
    }
    if (most < MIN_INLIERS)
        return fail(ERR_INPUT, "no picture shows enough that can be recognised and has depth; film a place with "
                               "things in it, in good light, or hang tags and list them");
    struct map_frame *f = &m->frames[m->fixed_frame];
    f->placed = f->visited = true;
    f->camera_from_world = POSE_IDENTITY;
    map_create_landmarks(m, f);
    return OK;
}
