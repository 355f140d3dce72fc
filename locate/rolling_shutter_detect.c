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
enum { LEAST_TAGS = 3 };
static const double MOST_COST = 15;
// Through a lens less sure than this tags contradict each other because of it.
static const double SURE_FOCAL_SIGMA = 0.01;

bool locator_notice_shutter(struct locator *l, const struct fit_tag *tags, const struct camera_fit *found)
{
    struct sighting seen[FIT_MAX_TAGS];
    struct fit_tag again[FIT_MAX_TAGS];
    struct shutter_motion unknown = shutter_unknown();
    struct lens rolling = l->lens;
    struct refiner *refiner;
    struct camera_fit fit;
    if (l->motion || l->count < LEAST_TAGS || (found && found->used == l->count) ||
        l->lens.focal_sigma > SURE_FOCAL_SIGMA)
        return false;
    rolling.readout_s = LIKELY_READOUT_S;
    for (int i = 0; i < l->count; i++) {
        again[i] = tags[i];
        again[i].seen = &seen[i];
        seen[i] = l->sightings[i];
        for (int k = 0; k < 4; k++)
            seen[i].time_s[k] = shutter_time(&rolling, lens_project(&rolling, seen[i].ray[k]).y);
    }
    if (fit_camera(again, l->count, rolling.fx, rolling.fy, l->options.max_rms_px, &unknown, &fit) == NOTHING ||
        fit.used < l->count || fit.cost > MOST_COST * fit.used || refiner_open(&refiner, &rolling) != OK)
        return false;
    refiner_close(&l->refiner);
    l->refiner = refiner;
    l->lens = rolling;
    l->motion = &l->moving;
    l->moving = unknown;
    memcpy(l->sightings, seen, sizeof *seen * (size_t)l->count);
    return true;
}
