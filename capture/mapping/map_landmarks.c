// Landmarks of the map: creation, matching, merging of duplicates, outlier removal, selection.
#include "capture/mapping/map_internal.h"

#include <stdlib.h>
#include <string.h>

// Chosen by hand.
static const double REMATCH_PX = 4;     // search radius about a landmark's projection in an adjusted map
static const double DUPLICATE_M = 0.03; // landmarks this near, per axis, with similar descriptors are one
enum { DUPLICATE_BITS = 40, ROUNDS = 6, REFINE_ROUNDS = 15 };

// Two views always agree on some depth along the epipolar line, so without depth a third one has to confirm it.
static int min_observations(const struct map *m) { return m->has_depth ? 2 : 3; }

void map_index_features(struct map_scratch *d, const struct map *m, const struct map_frame *f)
{
    for (int32_t i = 0; i < f->feature_count; i++) {
        d->features[i] = f->features[i].feature;
        d->depth[i] = f->features[i].depth;
    }
    feature_index_build(&d->index, d->features, f->feature_count, &m->calibration.color);
}

void map_assign_matches(struct map_frame *f, const struct map_scratch *d, int count)
{
    for (int32_t i = 0; i < f->feature_count; i++)
        f->features[i].point = -1;
    for (int i = 0; i < count; i++)
        f->features[d->matches[i].feature].point = d->matches[i].point;
}

void map_create_landmarks(struct map *m, struct map_frame *f)
{
    struct pose world_from_camera = pose_inverse(f->camera_from_world);
    if (!m->has_depth)
        map_triangulate(m, f);
    for (int32_t i = 0; i < f->feature_count && m->point_count < m->point_capacity; i++) {
        struct map_feature *s = &f->features[i];
        double depth = m->has_depth ? s->depth : s->triangulated_depth;
        if (s->point >= 0 || !(depth > 0))
            continue;
        struct vec3 ray = lens_ray(&m->calibration.color, s->feature.at);
        struct place_landmark *p = &m->points[m->point_count];
        *p = (struct place_landmark){.world = pose_apply(world_from_camera, v3_scale(ray, depth))};
        memcpy(p->descriptor, s->feature.descriptor, sizeof p->descriptor);
        s->point = m->point_count++;
    }
}

// Matches the map's landmarks in one frame, refines its pose by them, adds new ones.
static void add_frame_landmarks(struct map *m, struct map_scratch *d, struct map_frame *f)
{
    struct pnp_tag tags[PNP_MAX_TAGS];
    int count = 0, tag_count = map_tag_correspondences(m, f, tags), with_depth = 0;
    f->visited = true;
    map_index_features(d, m, f);
    const struct match_query query = map_match_query(m, d, tags, tag_count);
    bool known = landmarks_refine_pose(&query, NULL, &f->camera_from_world, d->matches, MAP_MAX_FEATURES, &count);
    map_assign_matches(f, d, known ? count : 0);
    for (int32_t i = 0; i < f->feature_count; i++)
        with_depth += !m->has_depth || f->features[i].depth > 0;
    // The pose from one tag alone is too inaccurate to add landmarks beside those of other frames. Where there are none
    // yet, the other frames are registered to this one and all are adjusted together.
    bool first = m->has_depth && !m->point_count;
    if ((known || tag_count > 1 || first) && 2 * count < with_depth)
        map_create_landmarks(m, f);
}

// Landmarks that are near each other and have similar descriptors become one.
static enum status merge_duplicates(struct map *m)
{
    int32_t *merged_into = malloc((size_t)(m->point_count + 1) * sizeof *merged_into);
    if (!merged_into)
        return fail(ERR_MEMORY, "no memory to compare %d points", (int)m->point_count);
    for (int32_t i = 0; i < m->point_count; i++) {
        merged_into[i] = i;
        for (int32_t k = 0; k < i && i >= m->held_points; k++) {
            struct vec3 d = v3_sub(m->points[i].world, m->points[k].world);
            if (merged_into[k] == k && fabs(d.x) < DUPLICATE_M && fabs(d.y) < DUPLICATE_M && fabs(d.z) < DUPLICATE_M &&
                feature_distance(m->points[i].descriptor, m->points[k].descriptor) < DUPLICATE_BITS) {
                merged_into[i] = k;
                break;
            }
        }
    }
    int32_t kept = 0;
    for (int32_t i = 0; i < m->point_count; i++) {
        if (merged_into[i] == i) {
            m->points[kept] = m->points[i];
            merged_into[i] = kept++;
        } else {
            merged_into[i] = merged_into[merged_into[i]]; // k < i, so already final
        }
    }
    for (int32_t i = 0; i < m->frame_count; i++)
        for (int32_t k = 0; k < m->frames[i].feature_count; k++)
            if (m->frames[i].features[k].point >= 0)
                m->frames[i].features[k].point = merged_into[m->frames[i].features[k].point];
    m->point_count = kept;
    free(merged_into);
    return OK;
}

// Matches every landmark in every placed frame again, near its projection.
static void rematch_all(struct map *m, struct map_scratch *d)
{
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        if (!f->placed)
            continue;
        map_index_features(d, m, f);
        const struct match_query query = map_match_query(m, d, NULL, 0);
        int count = landmarks_match(&query, (struct match_window){REMATCH_PX, false}, NULL, &f->camera_from_world,
                                    d->matches, MAP_MAX_FEATURES);
        map_assign_matches(f, d, count);
    }
}

static void count_observations(struct map *m)
{
    memset(m->point_observations, 0, (size_t)m->point_count * sizeof *m->point_observations);
    for (int32_t i = 0; i < m->frame_count; i++)
        for (int32_t k = 0; m->frames[i].placed && k < m->frames[i].feature_count; k++)
            if (m->frames[i].features[k].point >= 0)
                m->point_observations[m->frames[i].features[k].point]++;
}

// Removes observations that are outliers to the adjusted map (more than 4 standard deviations), then those of landmarks
// with too few observations left.
static void cull_outliers(struct map *m)
{
    const struct lens *lens = &m->calibration.color;
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; k < f->feature_count; k++) {
            struct map_feature *s = &f->features[k];
            if (s->point < 0)
                continue;
            struct vec3 ray = lens_ray(lens, s->feature.at);
            struct pnp_point p = {.world = m->points[s->point].world, .x = ray.x, .y = ray.y};
            landmark_covariance(&m->points[s->point], &s->feature, lens, &f->camera_from_world, p.covariance);
            if (!f->placed || pnp_point_error(&p, NULL, &f->camera_from_world, lens->fx, lens->fy) > 4)
                s->point = -1;
        }
    }
    count_observations(m);
    for (int32_t i = 0; i < m->frame_count; i++)
        for (int32_t k = 0; k < m->frames[i].feature_count; k++) {
            struct map_feature *s = &m->frames[i].features[k];
            if (s->point >= m->held_points && m->point_observations[s->point] < min_observations(m))
                s->point = -1;
        }
    count_observations(m);
}

// Without depth only a landmark's observations determine its distance. Where their chi-square is larger than in one
// case of a hundred, the landmark is not a single point (a T-junction of a near and a far edge, or one that slides
// along an edge), and its error exceeds its covariance. It is removed. chi2 with n degrees of freedom has mean n and
// variance 2n; two numbers an observation, three for the position.
static enum status cull_inconsistent(struct map *m)
{
    static const double ONE_IN_A_HUNDRED = 2.33; // standard deviations
    const struct lens *lens = &m->calibration.color;
    double *squares = calloc((size_t)m->point_count + 1, sizeof *squares);
    if (!squares)
        return fail(ERR_MEMORY, "no memory to check %d points", (int)m->point_count);
    for (int pass = 0; pass < 2; pass++)
        for (int32_t i = 0; i < m->frame_count; i++)
            for (int32_t k = 0; k < m->frames[i].feature_count; k++) {
                struct map_feature *s = &m->frames[i].features[k];
                if (s->point < m->held_points)
                    continue;
                struct vec3 ray = lens_ray(lens, s->feature.at);
                struct pnp_point p = {.world = m->points[s->point].world, .x = ray.x, .y = ray.y};
                match_covariance(&m->points[s->point], &s->feature, p.covariance);
                double error = pnp_point_error(&p, NULL, &m->frames[i].camera_from_world, lens->fx, lens->fy);
                double spare = 2.0 * m->point_observations[s->point] - 3;
                if (!pass)
                    squares[s->point] += error * error;
                else if (!(squares[s->point] <= spare + ONE_IN_A_HUNDRED * sqrt(2 * spare)))
                    s->point = -1;
            }
    free(squares);
    count_observations(m);
    return OK;
}

// The first frame to take landmarks from: the one that shows most mapped tags. -1: none.
static int32_t best_frame(const struct map *m)
{
    int32_t best = -1;
    int most = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct pnp_tag tags[PNP_MAX_TAGS];
        int count = m->frames[i].placed ? map_tag_correspondences(m, &m->frames[i], tags) : 0;
        if (count > most) {
            most = count;
            best = i;
        }
    }
    return best;
}

struct ranked {
    int32_t point, observations;
};

static int by_observations(const void *left, const void *right)
{
    const struct ranked *a = left, *b = right;
    if (a->observations != b->observations)
        return a->observations > b->observations ? -1 : 1;
    return (a->point > b->point) - (a->point < b->point);
}

// Observations that constrain a frame well enough while the map grows; more of them cost time. Chosen by hand.
enum { MIN_FRAME_OBSERVATIONS = 80 };

// The frames that show each landmark: those of landmark p are observers[start[p]] .. observers[start[p + 1] - 1].
struct covisibility {
    int32_t *start, *observers;
};

static void covisibility_free(struct covisibility *s)
{
    free(s->start);
    free(s->observers);
}

static enum status list_covisibility(const struct map *m, struct covisibility *out)
{
    size_t points = (size_t)m->point_count, observations = 0;
    for (size_t p = 0; p < points; p++)
        observations += (size_t)m->point_observations[p];
    *out =
        (struct covisibility){calloc(points + 1, sizeof *out->start), calloc(observations + 1, sizeof *out->observers)};
    if (!out->start || !out->observers) {
        covisibility_free(out);
        return fail(ERR_MEMORY, "no memory to adjust the map");
    }
    // Each start is first the end of the landmark's list; filling it backwards moves it to the beginning.
    int32_t end = 0;
    for (size_t p = 0; p < points; p++)
        out->start[p] = end += m->point_observations[p];
    out->start[points] = end;
    for (int32_t i = m->frame_count - 1; i >= 0; i--)
        for (int32_t k = 0; m->frames[i].placed && k < m->frames[i].feature_count; k++)
            if (m->frames[i].features[k].point >= 0)
                out->observers[--out->start[m->frames[i].features[k].point]] = i;
    return OK;
}

// Goes through the landmarks, those with most observations first, and includes each that is shown by a frame with too
// few included ones.
static void select_subset(const struct map *m, const struct covisibility *s, struct ranked *order, bool *included)
{
    int32_t held_by[MAP_MAX_FRAMES] = {0};
    for (int32_t i = 0; i < m->point_count; i++)
        order[i] = (struct ranked){i, m->point_observations[i]};
    qsort(order, (size_t)m->point_count, sizeof *order, by_observations);
    for (int32_t n = 0; n < m->point_count; n++) {
        int32_t point = order[n].point;
        for (int32_t k = s->start[point]; k < s->start[point + 1]; k++)
            included[point] = included[point] || held_by[s->observers[k]] < MIN_FRAME_OBSERVATIONS;
        for (int32_t k = s->start[point]; included[point] && k < s->start[point + 1]; k++)
            held_by[s->observers[k]]++;
    }
}

// Adjusts with as few landmarks as constrain the frames: enough while the map grows.
static enum status adjust_subset(struct map *m)
{
    struct covisibility covisibility;
    enum status status = list_covisibility(m, &covisibility);
    if (status != OK)
        return status;
    struct ranked *order = calloc((size_t)m->point_count + 1, sizeof *order);
    bool *included = calloc((size_t)m->point_count + 1, sizeof *included);
    if (order && included) {
        select_subset(m, &covisibility, order, included);
        status = map_bundle_adjust_subset(m, ROUNDS, included);
    } else {
        status = fail(ERR_MEMORY, "no memory to adjust the map");
    }
    covisibility_free(&covisibility);
    free(order);
    free(included);
    return status;
}

enum status map_build_landmarks(struct map *m)
{
    struct map_scratch *d = malloc(sizeof *d);
    if (!d)
        return fail(ERR_MEMORY, "no memory to map landmarks");
    int32_t start = best_frame(m);
    for (int32_t i = start; start >= 0 && i < m->frame_count; i++)
        if (m->frames[i].placed && !m->frames[i].visited)
            add_frame_landmarks(m, d, &m->frames[i]);
    for (int32_t i = start - 1; i >= 0; i--)
        if (m->frames[i].placed && !m->frames[i].visited)
            add_frame_landmarks(m, d, &m->frames[i]);
    cull_outliers(m);
    free(d);
    return adjust_subset(m);
}

// Keeps the constant landmarks, and of the others the `most` with most observations. ERR_MEMORY.
static enum status keep_best(struct map *m, int32_t most)
{
    struct ranked *order = malloc((size_t)(m->point_count + 1) * sizeof *order);
    int32_t *now = malloc((size_t)(m->point_count + 1) * sizeof *now);
    struct place_landmark *chosen = malloc((size_t)(m->point_count + 1) * sizeof *chosen);
    enum status status =
        order && now && chosen ? OK : fail(ERR_MEMORY, "no memory to choose among %d points", (int)m->point_count);
    int32_t count = 0, held = m->held_points;
    for (int32_t i = 0; i < held && status == OK; i++)
        now[i] = i;
    for (int32_t i = held; i < m->point_count && status == OK; i++) {
        now[i] = -1;
        if (m->point_observations[i] >= min_observations(m) && v3_finite(m->points[i].world))
            order[count++] = (struct ranked){i, m->point_observations[i]};
    }
    if (status == OK) {
        qsort(order, (size_t)count, sizeof *order, by_observations);
        count = count < most ? count : most;
        for (int32_t n = 0; n < count; n++) {
            chosen[n] = m->points[order[n].point];
            now[order[n].point] = held + n;
        }
        memcpy(m->points + held, chosen, (size_t)count * sizeof *chosen);
        m->point_count = held + count;
        for (int32_t i = 0; i < m->frame_count; i++)
            for (int32_t k = 0; k < m->frames[i].feature_count; k++)
                if (m->frames[i].features[k].point >= 0)
                    m->frames[i].features[k].point = now[m->frames[i].features[k].point];
        count_observations(m);
    }
    free(order);
    free(now);
    free(chosen);
    return status;
}

// Gives each new landmark the medoid of its observations' descriptors (Hamming distance). ERR_MEMORY.
static enum status select_descriptors(struct map *m)
{
    enum { MOST = 12 };
    const uint8_t **seen = calloc((size_t)m->point_count * MOST + 1, sizeof *seen);
    int *count = calloc((size_t)m->point_count + 1, sizeof *count);
    for (int32_t i = 0; i < m->frame_count && seen && count; i++)
        for (int32_t k = 0; k < m->frames[i].feature_count; k++) {
            const struct map_feature *s = &m->frames[i].features[k];
            if (s->point >= 0 && count[s->point] < MOST)
                seen[s->point * MOST + count[s->point]++] = s->feature.descriptor;
        }
    for (int32_t i = m->held_points; i < m->point_count && seen && count; i++) {
        int least = 1 << 30;
        for (int a = 0; a < count[i]; a++) {
            int sum = 0;
            for (int b = 0; b < count[i]; b++)
                sum += feature_distance(seen[i * MOST + a], seen[i * MOST + b]);
            if (sum < least) {
                least = sum;
                memcpy(m->points[i].descriptor, seen[i * MOST + a], sizeof m->points[i].descriptor);
            }
        }
    }
    enum status status = seen && count ? OK : fail(ERR_MEMORY, "no memory to describe %d points", (int)m->point_count);
    free(seen);
    free(count);
    return status;
}

enum status map_refine_landmarks(struct map *m, int32_t most)
{
    struct map_scratch *d = malloc(sizeof *d);
    if (!d)
        return fail(ERR_MEMORY, "no memory to map landmarks");
    enum status status = merge_duplicates(m);
    for (int round = 0; round < 2 && status == OK; round++) {
        rematch_all(m, d);
        if (!m->has_depth)
            status = map_cull_low_parallax(m);
        cull_outliers(m);
        if (status == OK)
            status = keep_best(m, most);
        if (status == OK)
            status = round ? map_bundle_adjust(m, REFINE_ROUNDS, false, NULL)
                           : map_bundle_adjust_depth_scale(m, REFINE_ROUNDS);
    }
    cull_outliers(m);
    if (!m->has_depth && status == OK)
        status = cull_inconsistent(m);
    if (!m->has_depth && status == OK) // without the observations just removed
        status = map_bundle_adjust(m, REFINE_ROUNDS, false, NULL);
    if (status == OK)
        status = keep_best(m, most);
    if (status == OK)
        status = select_descriptors(m);
    free(d);
    return status;
}
