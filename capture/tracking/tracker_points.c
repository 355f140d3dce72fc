// What the points of the colour image decide beside the fit: which component is the person, and that what depth takes
// for one is none.
#include "capture/tracking/tracker_internal.h"

#include "capture/tracking/point_hypotheses.h"

// Chosen by hand. Images in a row in which colour shows no person where depth has one: a new person is refused for so
// many, 2 s of a 30 Hz film of which every third image is looked at; then depth is believed, for colour may be blind to
// this person. What stays static meanwhile is furniture unless the body fits it well, sooner if colour shows a person
// elsewhere.
enum { REFUSED_IMAGES_MAX = 20, ELSEWHERE_IMAGES = 5 };
// Without an image for so many frames, depth decides alone.
enum { FRESH_FRAMES = 6 };
#define NOMINAL_DISTANCE_M 2.5 // of a person who is not segmented yet

static double person_distance_m(const struct tracker *t) { return 0.5 * (t->evidence->low.z + t->evidence->high.z); }

void tracker_begin_points(struct tracker *t)
{
    t->has_points = t->has_next_points;
    t->has_next_points = false;
    t->points.count = 0;
    t->frames_since_image = t->has_points ? 0 : t->frames_since_image + (t->frames_since_image < FRESH_FRAMES + 1);
    t->frames_since_points += t->frames_since_points < FRESH_FRAMES + 1;
}

enum status tracker_segment_new_person(struct tracker *t, const uint16_t *depth)
{
    struct bounding_sphere spheres[POINT_SPHERES_MAX];
    int count = 0;
    if (t->has_points) {
        point_evidence_read(&t->points, &t->next_points, &t->calibration, NOMINAL_DISTANCE_M);
        count = point_spheres(&t->points, &t->calibration.depth, depth, spheres);
        t->points.count = 0;
    }
    enum status status = count ? segmenter_next(t->segmenter, depth, spheres, count, t->mask) : NOTHING;
    return status == NOTHING ? segmenter_next(t->segmenter, depth, NULL, 0, t->mask) : status;
}

void tracker_take_points(struct tracker *t, struct fit_task *task)
{
    task->points = NULL;
    t->points.count = 0;
    if (!t->has_points)
        return;
    point_evidence_read(&t->points, &t->next_points, &t->calibration, person_distance_m(t));
    t->confirmed = points_are_on_person(&t->points, t->evidence, person_distance_m(t));
    if (!t->confirmed) { // they are another's, or the image is wrong
        t->elsewhere = t->points.count > 0;
        t->points.count = 0;
        return;
    }
    t->frames_since_points = 0;
    task->points = &t->points;
}

bool tracker_points_decide(const struct tracker *t) { return t->frames_since_points <= FRESH_FRAMES; }

void tracker_count_unconfirmed(struct tracker *t)
{
    if (t->has_points)
        t->unconfirmed_images = t->confirmed ? 0 : t->unconfirmed_images + 1;
}

bool tracker_is_person_refused(const struct tracker *t)
{
    if (t->backward || t->frames_since_image > FRESH_FRAMES)
        return false;
    return !t->has_points || (t->unconfirmed_images > 0 && t->unconfirmed_images <= REFUSED_IMAGES_MAX);
}

bool tracker_points_deny_person(const struct tracker *t, bool fits_well)
{
    if (!t->has_points)
        return false;
    if (t->elsewhere)
        return t->unconfirmed_images >= ELSEWHERE_IMAGES;
    return !fits_well && t->unconfirmed_images >= REFUSED_IMAGES_MAX;
}
