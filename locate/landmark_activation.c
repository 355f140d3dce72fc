// Landmark activation: landmarks that come into view while a camera is tracked become tracks. Feature extraction and
// matching are expensive, so only one or two small regions of each image are searched: where most tracks are likely to
// be gained.
#include "locate/locator_internal.h"

#include <string.h>

enum {
    // Chosen by hand.
    MISSING_PER_REGION = 20, // one region is searched for every so many missing tracks
    MAX_SEARCHES = 2,        // regions of one image, so that each image costs about the same
    CELLS_PER_REGION = 10,   // along the side of a region; each counts as one track to be gained
    CELLS_X = LOCATOR_REGIONS_X * CELLS_PER_REGION,
    CELLS_Y = LOCATOR_REGIONS_Y * CELLS_PER_REGION,
    MAX_MISSED_COUNT = 15, // bounds how little a landmark that is never found is expected to gain
    NO_POINT = 255,        // in a cell without landmarks
};
static const double MIN_DISTANCE_PX = 5; // tracks nearer to each other are redundant; chosen by hand
static const float MIN_GAIN = 1;         // expected new tracks, times images waited, that are worth a search

static bool crowded(const struct locator *l, struct pixel at)
{
    for (int i = 0; i < l->track_count; i++)
        if (fabs(l->tracks[i].at.x - at.x) < MIN_DISTANCE_PX && fabs(l->tracks[i].at.y - at.y) < MIN_DISTANCE_PX)
            return true;
    return false;
}

void locator_add_landmark_tracks(struct locator *l, int found, const struct pose *camera_from_world)
{
    for (int i = 0; i < found && l->track_count < LOCATOR_MAX_TRACKS; i++) {
        const struct feature *f = &l->index.features[l->matches[i].feature];
        l->missed_count[l->matches[i].point] = 0;
        double seen[3];
        if (crowded(l, f->at))
            continue;
        landmark_covariance(&l->points[l->matches[i].point], f, &l->lens, camera_from_world, seen);
        locator_add_track(l, l->matches[i].point, l->points[l->matches[i].point].world, seen, f->at, camera_from_world);
    }
}

// Where in the image landmarks should be seen.
struct search_gain {
    // Expected new tracks of a search in each region, times the images since the last one there.
    float gain[LOCATOR_REGIONS];
    uint8_t missed_count[CELLS_Y][CELLS_X]; // of the likeliest landmark in each cell, or NO_POINT
};

// The cell of a pixel, counted along the rows; -1: outside the image.
static int cell_of(const struct lens *lens, struct pixel at)
{
    int x = (int)(at.x * CELLS_X / lens->width), y = (int)(at.y * CELLS_Y / lens->height);
    return at.x < 0 || at.y < 0 || x >= CELLS_X || y >= CELLS_Y ? -1 : y * CELLS_X + x;
}

static int region_of_cell(int cell)
{
    return cell / CELLS_X / CELLS_PER_REGION * LOCATOR_REGIONS_X + cell % CELLS_X / CELLS_PER_REGION;
}

// Sorts the landmarks that should be seen by the region of the image in which they are.
static void sort_into_regions(struct locator *l, const struct pose *camera_from_world, struct search_gain *out)
{
    double r[3][3];
    const struct vec3 *t = &camera_from_world->translation;
    int32_t in_region[LOCATOR_REGIONS + 1] = {0};
    uint8_t *missed_count = &out->missed_count[0][0];
    memset(missed_count, NO_POINT, sizeof out->missed_count);
    quat_to_matrix(camera_from_world->rotation, r);
    for (int32_t i = 0; i < l->point_count; i++) {
        const struct vec3 w = l->points[i].world;
        struct vec3 p = {r[0][0] * w.x + r[0][1] * w.y + r[0][2] * w.z + t->x,
                         r[1][0] * w.x + r[1][1] * w.y + r[1][2] * w.z + t->y,
                         r[2][0] * w.x + r[2][1] * w.y + r[2][2] * w.z + t->z};
        int cell = locator_in_image(&l->lens, p) ? cell_of(&l->lens, lens_project(&l->lens, p)) : -1;
        l->region_of[i] = cell < 0 ? -1 : region_of_cell(cell);
        if (cell < 0)
            continue;
        missed_count[cell] = l->missed_count[i] < missed_count[cell] ? l->missed_count[i] : missed_count[cell];
        in_region[l->region_of[i] + 1]++;
    }
    for (int i = 0; i < LOCATOR_REGIONS; i++)
        in_region[i + 1] += in_region[i];
    memcpy(l->region_start, in_region, sizeof l->region_start);
    for (int32_t i = 0; i < l->point_count; i++)
        if (l->region_of[i] >= 0)
            l->points_by_region[in_region[l->region_of[i]]++] = i;
}

// Cells that a track covers gain nothing.
static void update_gain(struct locator *l, struct search_gain *e)
{
    uint8_t *missed_count = &e->missed_count[0][0];
    for (int i = 0; i < l->track_count; i++) {
        int cell = cell_of(&l->lens, l->tracks[i].at);
        if (cell >= 0)
            missed_count[cell] = NO_POINT;
    }
    memset(e->gain, 0, sizeof e->gain);
    for (int i = 0; i < CELLS_X * CELLS_Y; i++)
        if (missed_count[i] != NO_POINT)
            e->gain[region_of_cell(i)] += 1.0f / (float)(1 + missed_count[i]);
    for (int i = 0; i < LOCATOR_REGIONS; i++)
        e->gain[i] *= (float)++l->frames_unsearched[i];
}

// New landmarks in one region.
static enum status search_region(struct locator *l, int region, const uint16_t *depth,
                                 const struct pose *camera_from_world)
{
    const int32_t *which = l->points_by_region + l->region_start[region];
    int32_t count = l->region_start[region + 1] - l->region_start[region];
    enum status status = locator_extract_region_features(l, region, depth);
    if (status != OK)
        return status;
    for (int32_t i = 0; i < count; i++) {
        l->region_points[i] = l->points[which[i]];
        l->missed_count[which[i]] += l->missed_count[which[i]] < MAX_MISSED_COUNT;
    }
    const struct match_query query = {
        .points = l->region_points, .point_count = count, .index = &l->index, .lens = &l->lens};
    int found = landmarks_match(&query, (struct match_window){LANDMARK_NARROW_PX, false}, l->motion, camera_from_world,
                                l->matches, FEATURES_MAX);
    for (int i = 0; i < found; i++)
        l->matches[i].point = which[l->matches[i].point];
    locator_add_landmark_tracks(l, found, camera_from_world);
    return OK;
}

enum status locator_activate_landmarks(struct locator *l, const uint16_t *depth, const struct pose *camera_from_world)
{
    struct search_gain e;
    int missing = l->options.points - l->track_count,
        searches = (missing + MISSING_PER_REGION - 1) / MISSING_PER_REGION;
    searches = searches < MAX_SEARCHES ? searches : MAX_SEARCHES;
    if (searches <= 0 || !l->point_count)
        return OK;
    sort_into_regions(l, camera_from_world, &e);
    update_gain(l, &e);
    while (searches-- > 0) {
        int best = 0;
        for (int i = 1; i < LOCATOR_REGIONS; i++)
            if (e.gain[i] > e.gain[best])
                best = i;
        if (e.gain[best] < MIN_GAIN)
            break;
        enum status status = search_region(l, best, depth, camera_from_world);
        if (status != OK)
            return status;
        e.gain[best] = 0;
        l->frames_unsearched[best] = 0;
    }
    return OK;
}
