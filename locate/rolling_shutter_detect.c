// The shutter of a camera of which nobody said that it reads row by row. Swung, it shows tags where no pose of a camera
// that reads all rows at once can have them, and a pose by those that happen to agree may be a foot off. Where it is
// taken to have moved while it read, they fit.
#include "locate/locator_internal.h"

#include <string.h>

// Most cameras read a picture within 10 to 33 ms. How fast the camera moves is found out with the pose, and only what
// it moves within a picture matters, so a half more or less is none.
static const double LIKELY_READOUT_S = 0.03;
// Three tags say more numbers than a pose and a speed have; then what is left of each costs no more than twice what
// chance makes of its eight. A tag that was hung elsewhere does not come to fit by a camera's motion.
enum { MIN_TAGS = 3 };
static const double MAX_TAG_COST = 15;
// Through a lens less sure than this tags contradict each other because of it.
static const double SURE_FOCAL_SIGMA = 0.01;

bool locator_detect_rolling_shutter(struct locator *l, const struct pnp_tag *tags, const struct pnp_solution *found)
{
    struct tag_observation seen[PNP_MAX_TAGS];
    struct pnp_tag retimed[PNP_MAX_TAGS];
    struct shutter_motion unknown = shutter_motion_unknown();
    struct lens rolling = l->lens;
    struct tag_refiner *refiner;
    struct pnp_solution fit;
    if (l->motion || l->count < MIN_TAGS || (found && found->used == l->count) ||
        l->lens.focal_sigma > SURE_FOCAL_SIGMA)
        return false;
    rolling.readout_s = LIKELY_READOUT_S;
    for (int i = 0; i < l->count; i++) {
        retimed[i] = tags[i];
        retimed[i].seen = &seen[i];
        seen[i] = l->observations[i];
        for (int k = 0; k < 4; k++)
            seen[i].time_s[k] = shutter_row_time(&rolling, lens_project(&rolling, seen[i].ray[k]).y);
    }
    if (pnp_solve(retimed, l->count, rolling.fx, rolling.fy, l->options.max_rms_px, &unknown, &fit) == NOTHING ||
        fit.used < l->count || fit.cost > MAX_TAG_COST * fit.used || tag_refiner_open(&refiner, &rolling) != OK)
        return false;
    tag_refiner_close(&l->refiner);
    l->refiner = refiner;
    l->lens = rolling;
    l->motion = &l->frame_motion;
    l->frame_motion = unknown;
    memcpy(l->observations, seen, sizeof *seen * (size_t)l->count);
    return true;
}
