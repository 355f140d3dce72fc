// Points of the place that come into sight while a camera is followed. To recognise one is dear, so only
// a small part of each picture is searched: where most are likely to be gained.
#include "locate/locator_internal.h"

#include <string.h>

enum {
    IN_A_PART = 20, // more are missing for each part of a picture that is searched
    MOST_LOOKS = 2, // parts of one picture: each picture costs about the same
    SQUARES = 10,   // along the side of a part; each counts as one track to be gained
    SQUARES_ACROSS = LOCATOR_ACROSS * SQUARES,
    SQUARES_DOWN = LOCATOR_DOWN * SQUARES,
    MOST_VAIN = 15, // searches that say that a point is not to be found: then one in so many is worth it
    NOBODY = 255,   // in a square without points
};
static const double APART_PX = 5;  // tracks nearer to each other tell the same
static const float LEAST_GAIN = 1; // expected new tracks, times pictures waited, that are worth a search

static bool crowded(const struct locator *l, struct pixel at)
{
    for (int i = 0; i < l->track_count; i++)
        if (fabs(l->tracks[i].at.x - at.x) < APART_PX && fabs(l->tracks[i].at.y - at.y) < APART_PX)
            return true;
    return false;
}

void locator_add_points(struct locator *l, int found, const struct pose *camera_from_world)
{
    for (int i = 0; i < found && l->track_count < LOCATOR_MOST_TRACKS; i++) {
        const struct feature *f = &l->index.features[l->matches[i].feature];
        l->vain[l->matches[i].point] = 0;
        double seen[3];
        if (crowded(l, f->at))
            continue;
        points_covariance(&l->points[l->matches[i].point], f, &l->lens, camera_from_world, seen);
        locator_add_track(l, l->matches[i].point, l->points[l->matches[i].point].world, seen, f->at, camera_from_world);
    }
}

// Where in the picture points of the place should be seen.
struct expected {
    // How many new tracks a search in each part is likely to give, times the pictures since the last one there.
    float gain[LOCATOR_PARTS];
    uint8_t vain[SQUARES_DOWN][SQUARES_ACROSS]; // of the likeliest point in each square; NOBODY: there is none
};

// The square of a pixel, counted along the rows; -1: outside the picture.
static int square_of(const struct lens *lens, struct pixel at)
{
    int x = (int)(at.x * SQUARES_ACROSS / lens->width), y = (int)(at.y * SQUARES_DOWN / lens->height);
    return at.x < 0 || at.y < 0 || x >= SQUARES_ACROSS || y >= SQUARES_DOWN ? -1 : y * SQUARES_ACROSS + x;
}

static int part_of(int square)
{
    return square / SQUARES_ACROSS / SQUARES * LOCATOR_ACROSS + square % SQUARES_ACROSS / SQUARES;
}

// The points of the place that should be seen, by the part of the picture in which they lie.
static void sort_into_parts(struct locator *l, const struct pose *camera_from_world, struct expected *out)
{
    double turn[3][3];
    const struct vec3 *shift = &camera_from_world->translation;
    int32_t in_part[LOCATOR_PARTS + 1] = {0};
    uint8_t *vain = &out->vain[0][0];
    memset(vain, NOBODY, sizeof out->vain);
    quat_to_matrix(camera_from_world->rotation, turn);
    for (int32_t i = 0; i < l->point_count; i++) {
        const struct vec3 w = l->points[i].world;
        struct vec3 p = {turn[0][0] * w.x + turn[0][1] * w.y + turn[0][2] * w.z + shift->x,
                         turn[1][0] * w.x + turn[1][1] * w.y + turn[1][2] * w.z + shift->y,
                         turn[2][0] * w.x + turn[2][1] * w.y + turn[2][2] * w.z + shift->z};
        int square = locator_in_picture(&l->lens, p) ? square_of(&l->lens, lens_project(&l->lens, p)) : -1;
        l->part_of[i] = square < 0 ? -1 : part_of(square);
        if (square < 0)
            continue;
        vain[square] = l->vain[i] < vain[square] ? l->vain[i] : vain[square];
        in_part[l->part_of[i] + 1]++;
    }
    for (int i = 0; i < LOCATOR_PARTS; i++)
        in_part[i + 1] += in_part[i];
    memcpy(l->part_start, in_part, sizeof l->part_start);
    for (int32_t i = 0; i < l->point_count; i++)
        if (l->part_of[i] >= 0)
            l->in_parts[in_part[l->part_of[i]]++] = i;
}

static void expect_gain(struct locator *l, struct expected *e)
{
    uint8_t *vain = &e->vain[0][0];
    for (int i = 0; i < l->track_count; i++) {
        int square = square_of(&l->lens, l->tracks[i].at);
        if (square >= 0)
            vain[square] = NOBODY;
    }
    memset(e->gain, 0, sizeof e->gain);
    for (int i = 0; i < SQUARES_ACROSS * SQUARES_DOWN; i++)
        if (vain[i] != NOBODY)
            e->gain[part_of(i)] += 1.0f / (float)(1 + vain[i]);
    for (int i = 0; i < LOCATOR_PARTS; i++)
        e->gain[i] *= (float)++l->unsearched[i];
}

// New points in one part of the picture.
static enum status look_in(struct locator *l, int part, const uint16_t *depth, const struct pose *camera_from_world)
{
    const int32_t *which = l->in_parts + l->part_start[part];
    int32_t count = l->part_start[part + 1] - l->part_start[part];
    enum status status = locator_find_features_in(l, part, depth);
    if (status != OK)
        return status;
    for (int32_t i = 0; i < count; i++) {
        l->some_points[i] = l->points[which[i]];
        l->vain[which[i]] += l->vain[which[i]] < MOST_VAIN;
    }
    int found = points_match(l->some_points, count, &l->index, &l->lens, l->motion, camera_from_world, POINTS_NEAR_PX,
                             false, l->matches, FEATURES_MAX);
    for (int i = 0; i < found; i++)
        l->matches[i].point = which[l->matches[i].point];
    locator_add_points(l, found, camera_from_world);
    return OK;
}

enum status locator_look_for_new(struct locator *l, const uint16_t *depth, const struct pose *camera_from_world)
{
    struct expected e;
    int missing = l->options.points - l->track_count, looks = (missing + IN_A_PART - 1) / IN_A_PART;
    looks = looks < MOST_LOOKS ? looks : MOST_LOOKS;
    if (looks <= 0 || !l->point_count)
        return OK;
    sort_into_parts(l, camera_from_world, &e);
    expect_gain(l, &e);
    while (looks-- > 0) {
        int best = 0;
        for (int i = 1; i < LOCATOR_PARTS; i++)
            if (e.gain[i] > e.gain[best])
                best = i;
        if (e.gain[best] < LEAST_GAIN)
            break;
        enum status status = look_in(l, best, depth, camera_from_world);
        if (status != OK)
            return status;
        e.gain[best] = 0;
        l->unsearched[best] = 0;
    }
    return OK;
}
