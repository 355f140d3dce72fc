// What the points of the colour image decide beside the fit: which component is the person, and that what depth takes
// for one is none.
#include "capture/tracking/point_hypotheses.h"
#include "capture/tracking/tracker_internal.h"

// Chosen by hand. Images in a row in which colour shows no person where depth has one: a new person is refused for so
// many, 2 s of a 30 Hz film of which every third image is looked at; then depth is believed, for colour may be blind to
// this person. What stays static meanwhile is furniture unless the body fits it well, sooner if colour shows a person
// elsewhere.
enum { REFUSED_IMAGES_MAX = 20, ELSEWHERE_IMAGES = 5 };
// Without an image for so many frames, depth decides alone.
enum { FRESH_FRAMES = 6 };
#define NOMINAL_DISTANCE_M 2.5 // of a person who is not segmented yet

static double person_distance_m(const struct tracker *tracker)
{
    return 0.5 * (tracker->evidence->low.z + tracker->evidence->high.z);
}

void tracker_begin_points(struct tracker *tracker)
{
    tracker->has_points = tracker->has_next_points;
    tracker->has_next_points = false;
    tracker->points.count = 0;
    tracker->frames_since_image =
        tracker->has_points ? 0 : tracker->frames_since_image + (tracker->frames_since_image < FRESH_FRAMES + 1);
    tracker->frames_since_points += tracker->frames_since_points < FRESH_FRAMES + 1;
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

void tracker_take_points(struct tracker *tracker, struct fit_task *task)
{
    task->points = NULL;
    tracker->points.count = 0;
    if (!tracker->has_points)
        return;
    point_evidence_read(&tracker->points, &tracker->next_points, &tracker->calibration, person_distance_m(tracker));
    tracker->confirmed = points_are_on_person(&tracker->points, tracker->evidence, person_distance_m(tracker));
    if (!tracker->confirmed) { // they are another's, or the image is wrong
        tracker->elsewhere = tracker->points.count > 0;
        tracker->points.count = 0;
        return;
    }
    tracker->frames_since_points = 0;
    task->points = &tracker->points;
}

bool tracker_points_decide(const struct tracker *tracker) { return tracker->frames_since_points <= FRESH_FRAMES; }

void tracker_count_unconfirmed(struct tracker *tracker)
{
    if (tracker->has_points)
        tracker->unconfirmed_images = tracker->confirmed ? 0 : tracker->unconfirmed_images + 1;
}

bool tracker_is_person_refused(const struct tracker *tracker)
{
    if (tracker->backward || tracker->frames_since_image > FRESH_FRAMES)
        return false;
    return !tracker->has_points ||
           (tracker->unconfirmed_images > 0 && tracker->unconfirmed_images <= REFUSED_IMAGES_MAX);
}

bool tracker_points_deny_person(const struct tracker *tracker, bool fits_well)
{
    if (!tracker->has_points)
        return false;
    if (tracker->elsewhere)
        return tracker->unconfirmed_images >= ELSEWHERE_IMAGES;
    return !fits_well && tracker->unconfirmed_images >= REFUSED_IMAGES_MAX;
}
