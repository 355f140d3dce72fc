#include "locate/points.h"

#include <stdlib.h>
#include <string.h>

enum {
    CELL_PX = 16,
    MOST_BITS = 64, // of 256 that may differ
    CLEARLY = 80,   // percent: the best must differ by less than this share of the second best
    LEAST_POINTS = 12,
};

void feature_index_build(struct feature_index *index, const struct feature *features, int count,
                         const struct lens *lens)
{
    index->features = features;
    index->count = count < FEATURES_MAX ? count : FEATURES_MAX;
    int cell = CELL_PX;
    do {
        index->across = (lens->width + cell - 1) / cell;
        index->down = (lens->height + cell - 1) / cell;
        cell *= 2;
    } while (index->across * index->down > 4096);
    memset(index->start, 0, sizeof index->start);
    int cells[FEATURES_MAX];
    for (int i = 0; i < index->count; i++) {
        int x = (int)(features[i].at.x * index->across / lens->width),
            y = (int)(features[i].at.y * index->down / lens->height);
        x = x < 0 ? 0 : x >= index->across ? index->across - 1 : x;
        y = y < 0 ? 0 : y >= index->down ? index->down - 1 : y;
        cells[i] = y * index->across + x;
        index->start[cells[i] + 1]++;
    }
    for (int i = 0; i < index->across * index->down; i++)
        index->start[i + 1] += index->start[i];
    int next[4097];
    memcpy(next, index->start, sizeof next);
    for (int i = 0; i < index->count; i++)
        index->order[next[cells[i]]++] = i;
}

// The feature within the radius that looks most like the point; -1: none, or not clearly.
static int best_feature(const struct place_point *point, const struct feature_index *index, const struct lens *lens,
                        struct pixel at, double radius, int *bits)
{
    int x0 = (int)((at.x - radius) * index->across / lens->width),
        x1 = (int)((at.x + radius) * index->across / lens->width);
    int y0 = (int)((at.y - radius) * index->down / lens->height),
        y1 = (int)((at.y + radius) * index->down / lens->height);
    x0 = x0 < 0 ? 0 : x0, y0 = y0 < 0 ? 0 : y0;
    x1 = x1 >= index->across ? index->across - 1 : x1, y1 = y1 >= index->down ? index->down - 1 : y1;
    int best = -1, second = 256;
    *bits = 257;
    for (int y = y0; y <= y1; y++) {
        for (int k = index->start[y * index->across + x0]; k < index->start[y * index->across + x1 + 1]; k++) {
            const struct feature *f = &index->features[index->order[k]];
            double dx = f->at.x - at.x, dy = f->at.y - at.y;
            if (dx * dx + dy * dy > radius * radius)
                continue;
            int d = feature_distance(point->descriptor, f->descriptor);
            // The same corner in another copy of the picture is no rival.
            bool same =
                best >= 0 && hypot(f->at.x - index->features[best].at.x, f->at.y - index->features[best].at.y) < 3;
            if (d < *bits) {
                if (!same)
                    second = *bits;
                *bits = d;
                best = index->order[k];
            } else if (!same && d < second) {
                second = d;
            }
        }
    }
    return *bits <= MOST_BITS && *bits * 100 < CLEARLY * second ? best : -1;
}

int points_match(const struct place_point *points, int32_t point_count, const struct feature_index *index,
                 const struct lens *lens, const struct pose *camera_from_world, double radius_px,
                 struct point_match *out, int capacity)
{
    int32_t owner[FEATURES_MAX];
    int bits_of[FEATURES_MAX];
    double wide = 0.8 * lens->width / lens->fx, high = 0.8 * lens->height / lens->fy;
    for (int i = 0; i < index->count; i++)
        owner[i] = -1;
    for (int32_t i = 0; i < point_count; i++) {
        struct vec3 p = pose_apply(*camera_from_world, points[i].world);
        if (!(p.z > 0.1) || fabs(p.x) > wide * p.z || fabs(p.y) > high * p.z)
            continue;
        struct pixel at = lens_project(lens, p);
        if (!(at.x > -radius_px && at.y > -radius_px && at.x < lens->width + radius_px &&
              at.y < lens->height + radius_px))
            continue;
        int bits, f = best_feature(&points[i], index, lens, at, radius_px, &bits);
        if (f >= 0 && (owner[f] < 0 || bits < bits_of[f])) {
            owner[f] = i;
            bits_of[f] = bits;
        }
    }
    int count = 0;
    for (int f = 0; f < index->count && count < capacity; f++)
        if (owner[f] >= 0)
            out[count++] = (struct point_match){owner[f], f};
    return count;
}

static int gather(const struct place_point *points, const struct feature_index *index, const double *depth,
                  const struct lens *lens, const struct point_match *matches, int count, struct fit_point *out)
{
    for (int i = 0; i < count; i++) {
        const struct feature *f = &index->features[matches[i].feature];
        struct vec3 ray = lens_ray(lens, f->at);
        out[i] = (struct fit_point){points[matches[i].point].world, ray.x, ray.y, feature_sigma(f),
                                    depth ? depth[matches[i].feature] : 0};
    }
    return count;
}

bool points_refine(const struct place_point *points, int32_t point_count, const struct feature_index *index,
                   const double *depth, const struct lens *lens, const struct fit_tag *tags, int tag_count,
                   struct pose *camera_from_world, struct point_match *matches, int capacity, int *match_count)
{
    // Searched ever nearer, each time from the pose that the last search gave; the
    // fit of each begins as loose as the search.
    static const double RADIUS_PX[] = {40, 15, 6, 4};
    struct fit_point seen[FEATURES_MAX];
    struct pose pose = *camera_from_world;
    int count = 0;
    if (capacity > FEATURES_MAX)
        capacity = FEATURES_MAX;
    for (size_t round = 0; round < COUNT_OF(RADIUS_PX); round++) {
        count = points_match(points, point_count, index, lens, &pose, RADIUS_PX[round], matches, capacity);
        if (count < LEAST_POINTS)
            return false;
        gather(points, index, depth, lens, matches, count, seen);
        for (double loose = RADIUS_PX[round] / 3; loose > 0.5; loose /= 3)
            fit_refine(tags, tag_count, 0, seen, count, loose, lens->fx, lens->fy, &pose);
    }
    fit_refine(tags, tag_count, 0, seen, count, 0, lens->fx, lens->fy, &pose);
    int kept = 0;
    for (int i = 0; i < count; i++)
        if (fit_point_error(&seen[i], &pose, lens->fx, lens->fy) < 4)
            matches[kept++] = matches[i];
    if (kept < LEAST_POINTS || 2 * kept < count)
        return false;
    *camera_from_world = pose;
    *match_count = kept;
    return true;
}
