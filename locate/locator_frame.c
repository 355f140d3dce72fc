// The current image of the locator: its tags, features, and the pose problem that they make.
#include "locate/locator_internal.h"

#include <string.h>

// Tags smaller than this, along their shortest side, are not searched for by prediction: their pattern is a blur.
// Chosen by hand.
static const double MIN_PREDICTED_PX = 10;
// The number of a predicted tag was not decoded, so its pattern must correlate well. Chosen by hand.
static const double PREDICTED_MIN_CORRELATION = 0.8;

void locator_begin_frame(struct locator *l, const uint8_t *color)
{
    locator_update_lens(l);
    gray_from_rgb(color, (size_t)l->lens.width * (size_t)l->lens.height, l->gray);
    l->frame_motion = l->expected;
    l->expected = shutter_motion_unknown();
}

void locator_add_observation(struct locator *l, const struct tag_observation *seen, int32_t which,
                             const uint16_t *depth)
{
    l->observations[l->observed_count] = *seen;
    l->observed_tag[l->observed_count] = which;
    l->depths[l->observed_count].count = 0;
    if (depth)
        tag_read_depth(seen, &l->lens, depth, &l->depths[l->observed_count]);
    l->observed_count++;
}

void locator_pnp_tags(const struct locator *l, struct pnp_tag *tags)
{
    for (int i = 0; i < l->observed_count; i++) {
        const struct place_tag *tag = &l->tags[l->observed_tag[i]];
        tags[i] = (struct pnp_tag){
            .seen = &l->observations[i],
            .depth = l->depths[i].count ? &l->depths[i] : NULL,
            .world_from_tag = tag->world_from_tag,
            .side_m = tag->side_m,
            .map_px = tag->rms_px / sqrt(2), // of a corner's x or y
            .covariance = tag->covariance,
        };
    }
}

struct pose_problem locator_problem(const struct locator *l, struct pnp_tag *tags, const struct pnp_point *points,
                                    int point_count)
{
    return (struct pose_problem){.tags = tags,
                                 .tag_count = tags ? l->observed_count : 0,
                                 .points = points,
                                 .point_count = point_count,
                                 .fx = l->lens.fx,
                                 .fy = l->lens.fy,
                                 .motion = l->motion};
}

int locator_select_inlier_tags(const struct locator *l, struct pnp_tag *tags, const struct shutter_motion *motion,
                               const struct pose *camera_from_world)
{
    int used = 0;
    for (int i = 0; i < l->observed_count; i++) {
        tags[i].rms_px = pnp_tag_rms(&tags[i], motion, camera_from_world, l->lens.fx, l->lens.fy);
        tags[i].used = tags[i].rms_px <= l->options.max_rms_px;
        used += tags[i].used;
    }
    return used;
}

// Where a tag must appear. False: not wholly in the image, from behind, too small.
static bool predict_corners(const struct locator *l, const struct place_tag *tag, const struct pose *camera_from_world,
                            struct pixel corner[4])
{
    struct vec3 world[4];
    place_tag_corners(tag, world);
    struct vec3 centre = pose_apply(*camera_from_world, tag->world_from_tag.translation);
    struct quat rotation = quat_multiply(camera_from_world->rotation, tag->world_from_tag.rotation);
    if (!(v3_dot(quat_rotate(rotation, v3(0, 0, 1)), centre) < 0))
        return false;
    for (int k = 0; k < 4; k++) {
        struct vec3 p = pose_apply(*camera_from_world, world[k]);
        // Far outside the image the distortion polynomial is not valid.
        if (!(p.z > 0.05) || fabs(p.x / p.z) > l->lens.width / l->lens.fx ||
            fabs(p.y / p.z) > l->lens.height / l->lens.fy)
            return false;
        corner[k] = shutter_project(&l->lens, l->motion, p);
        if (!(corner[k].x >= 1 && corner[k].y >= 1 && corner[k].x <= l->lens.width - 2 &&
              corner[k].y <= l->lens.height - 2))
            return false;
    }
    double shortest = 1e9;
    for (int k = 0; k < 4; k++)
        shortest = fmin(shortest, hypot(corner[k].x - corner[(k + 1) % 4].x, corner[k].y - corner[(k + 1) % 4].y));
    return shortest >= MIN_PREDICTED_PX;
}

int locator_detect_predicted(struct locator *l, const uint8_t *color, const uint16_t *depth,
                             const struct pose *camera_from_world, int most_pixels, int *missing)
{
    int before = l->observed_count, predicted_count = 0;
    for (int32_t k = 0; k < l->tag_count && l->observed_count < PNP_MAX_TAGS; k++) {
        bool seen = false;
        for (int i = 0; i < l->observed_count; i++)
            seen = seen || l->observed_tag[i] == k;
        struct tag_candidate candidate = {.id = l->tags[k].id, .pattern = &l->patterns[k]};
        struct tag_observation fine;
        if (seen || !predict_corners(l, &l->tags[k], camera_from_world, candidate.corner))
            continue;
        predicted_count++;
        if (tag_refine_sampled(l->refiner, color, &candidate, most_pixels, &fine) &&
            fine.correlation > PREDICTED_MIN_CORRELATION)
            locator_add_observation(l, &fine, k, depth);
    }
    if (missing)
        *missing = predicted_count - (l->observed_count - before);
    return l->observed_count - before;
}

double locator_rms(const struct locator *l, const struct pnp_tag *tags, const struct pose *camera_from_world)
{
    double sum = 0;
    int used = 0;
    for (int i = 0; i < l->observed_count; i++) {
        if (!tags[i].used)
            continue;
        double rms = pnp_tag_rms(&tags[i], l->motion, camera_from_world, l->lens.fx, l->lens.fy);
        sum += rms * rms;
        used++;
    }
    return used ? sqrt(sum / used) : 0;
}

static enum status index_features(struct locator *l, enum status status, int count, const uint16_t *depth)
{
    if (status != OK)
        return status;
    feature_index_build(&l->index, l->features, count, &l->lens);
    for (int i = 0; i < count && depth; i++)
        l->feature_depths[i] = feature_depth(&l->lens, depth, l->features[i].at);
    return OK;
}

enum status locator_extract_features(struct locator *l, const uint16_t *depth)
{
    int count;
    enum status status =
        features_detect(l->gray, l->lens.width, l->lens.height, l->features, l->options.features, &count);
    return index_features(l, status, count, depth);
}

enum status locator_extract_region_features(struct locator *l, int region, const uint16_t *depth)
{
    enum { BEYOND_PX = 24 }; // more than the margin without features at the edges of a region
    int width = l->lens.width, height = l->lens.height, count;
    int column = region % LOCATOR_REGIONS_X, row = region / LOCATOR_REGIONS_X;
    int left = column * width / LOCATOR_REGIONS_X - BEYOND_PX,
        right = (column + 1) * width / LOCATOR_REGIONS_X + BEYOND_PX;
    int top = row * height / LOCATOR_REGIONS_Y - BEYOND_PX, bottom = (row + 1) * height / LOCATOR_REGIONS_Y + BEYOND_PX;
    left = left > 0 ? left : 0, right = right < width ? right : width;
    top = top > 0 ? top : 0, bottom = bottom < height ? bottom : height;
    const struct image_region area = {left, top, right - left, bottom - top};
    enum status status =
        features_detect_region(l->gray, width, &area, l->features, 2 * FEATURES_MAX / LOCATOR_REGIONS, &count);
    return index_features(l, status, count, depth);
}

bool locator_fill_result(const struct locator *l, const struct pnp_solution *found, int point_count,
                         const double covariance[36], const double noise[36], struct location *out)
{
    double sigma_m = sqrt(covariance[21] + covariance[28] + covariance[35]);
    if (!(sigma_m <= l->options.max_position_sigma_m))
        return false;
    *out = (struct location){
        .world_from_camera = pose_inverse(found->camera_from_world),
        .rms_px = found->rms_px,
        .tags_used = found->used,
        .tags_rejected = l->observed_count - found->used,
        .points_used = point_count,
        .position_sigma_m = sigma_m,
        .other = pose_inverse(found->other),
        .other_excess_cost = found->other_excess_cost,
    };
    memcpy(out->covariance, covariance, sizeof out->covariance);
    memcpy(out->noise, noise, sizeof out->noise);
    return true;
}
