// Detects a rolling shutter that the camera's lens does not mention. When such a camera rotates, no pose fits all tags,
// and one by those that happen to agree may be 30 cm off. The test: with a read-out time and a velocity all tags fit.
#include "locate/locator_internal.h"

#include <string.h>

// Most cameras read an image within 10 to 33 ms. The velocity is estimated with the pose, and only the motion within an
// image matters, so an error of a half in the read-out time is absorbed by the velocity.
static const double LIKELY_READOUT_S = 0.03;
// Three tags give 24 numbers for the 12 of pose and velocity. Each tag may cost twice the mean robust cost of eight
// normal errors (7.5, see pnp_covariance); a tag that was moved does not fit by a camera's motion.
enum { MIN_TAGS = 3 };
static const double MAX_TAG_COST = 15;
// With a less certain focal length, tags contradict each other because of it.
static const double SURE_FOCAL_SIGMA = 0.01;

bool locator_detect_rolling_shutter(struct locator *l, const struct pnp_tag *tags, const struct pnp_solution *found)
{
    struct tag_observation seen[PNP_MAX_TAGS];
    struct pnp_tag retimed[PNP_MAX_TAGS];
    struct shutter_motion unknown = shutter_motion_unknown();
    struct lens rolling = l->lens;
    struct tag_refiner *refiner;
    struct pnp_solution fit;
    if (l->motion || l->observed_count < MIN_TAGS || (found && found->used == l->observed_count) ||
        l->lens.focal_sigma > SURE_FOCAL_SIGMA)
        return false;
    rolling.readout_s = LIKELY_READOUT_S;
    for (int i = 0; i < l->observed_count; i++) {
        retimed[i] = tags[i];
        retimed[i].seen = &seen[i];
        seen[i] = l->observations[i];
        for (int k = 0; k < 4; k++)
            seen[i].time_s[k] = shutter_row_time(&rolling, lens_project(&rolling, seen[i].ray[k]).y);
    }
    const struct pose_problem problem = {
        .tags = retimed, .tag_count = l->observed_count, .fx = rolling.fx, .fy = rolling.fy, .motion = &unknown};
    if (pnp_solve(&problem, l->options.max_rms_px, &fit) == NOTHING || fit.used < l->observed_count ||
        fit.cost > MAX_TAG_COST * fit.used || tag_refiner_open(&refiner, &rolling) != OK)
        return false;
    tag_refiner_close(&l->refiner);
    l->refiner = refiner;
    l->lens = rolling;
    l->motion = &l->frame_motion;
    l->frame_motion = unknown;
    memcpy(l->observations, seen, sizeof *seen * (size_t)l->observed_count);
    return true;
}
