#include "locate/camera_tracker.h"

#include "locate/pose_fusion.h"

#include <stdlib.h>
#include <string.h>

// Gate of the Kalman update, chi squared with six degrees of freedom: exceeded by chance once in ten million images.
// Else the camera was moved abruptly, or the velocity was wrong.
static const double MAX_CHI2 = 43;
// Tracks are looked for within some ten pixels of their prediction. Where that is uncertain by many times as much (one
// standard deviation), what is found is as likely something that looks similar, and all of it agrees only on the
// prediction itself. So at two or three images a second, or after a gap, an image is localised from scratch. Chosen by
// hand.
static const double MAX_PREDICTED_SIGMA_PX = 120;
// After so long without a pose the motion is forgotten. Chosen by hand.
static const double LOST_S = 0.5;
// One of two mirrored poses has won when their chi squared differ by this (twice the log-odds). Chosen by hand.
static const double DECISIVE_CHI2 = 25;

// A single image by a rolling shutter determines the velocity badly, and the pose's error due to that stays in the
// biases of all tracks. After so many tracked images the next one is localised from scratch, with the velocity that
// they gave as its prior.
enum { VELOCITY_FRAMES = 1 };

struct camera_tracker {
    struct locator *locator;
    int tracked;        // images since the last one localised from scratch
    int64_t time_ns;    // of the last image
    bool started;       // time_ns is valid
    bool without_prior; // the current image is to be localised without the tracks
    int count;          // of filters: 0 lost, 2 for two mirrored poses that are not yet decided
    struct pose_kalman filters[2];
    double chi2[2];      // sums of squared Mahalanobis distances of each filter
    double since_seen_s; // since the last pose
};

enum status camera_tracker_open(struct camera_tracker **out, const struct place *place, const struct lens *lens,
                                const struct locator_options *options)
{
    *out = NULL;
    struct camera_tracker *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "no memory to track a camera");
    enum status status = locator_open(&t->locator, place, lens, options);
    if (status != OK)
        camera_tracker_close(&t);
    *out = t;
    return status;
}

void camera_tracker_close(struct camera_tracker **tracker)
{
    if (*tracker)
        locator_close(&(*tracker)->locator);
    free(*tracker);
    *tracker = NULL;
}

static void start_filters(struct camera_tracker *tracker, const struct location *found, bool ambiguous)
{
    tracker->count = ambiguous ? 2 : 1;
    tracker->tracked = 0;
    tracker->chi2[0] = tracker->chi2[1] = 0;
    pose_kalman_start(&tracker->filters[0], found->world_from_camera, found->covariance);
    pose_kalman_start(&tracker->filters[1], found->other, found->covariance);
}

// Updates each filter by the measured pose, or by its mirrored one if that agrees better. False: it agrees with none.
static bool update_filters(struct camera_tracker *tracker, const struct location *found, bool ambiguous)
{
    bool agrees = false;
    for (int i = 0; i < tracker->count; i++) {
        struct pose_kalman with[2] = {tracker->filters[i], tracker->filters[i]};
        double off[2];
        off[0] = pose_kalman_update(&with[0], found->world_from_camera, found->noise, MAX_CHI2);
        off[1] = ambiguous ? pose_kalman_update(&with[1], found->other, found->noise, MAX_CHI2) : INFINITY;
        int which = off[1] < off[0];
        if (off[which] <= MAX_CHI2) {
            tracker->filters[i] = with[which];
            tracker->chi2[i] += off[which] + (which ? found->other_excess_cost : 0);
            agrees = true;
        } else {
            tracker->chi2[i] += MAX_CHI2;
        }
    }
    for (int i = 0; tracker->count == 2 && i < 2; i++) {
        if (tracker->chi2[i] - tracker->chi2[!i] > DECISIVE_CHI2) {
            tracker->filters[0] = tracker->filters[!i];
            tracker->count = 1;
        }
    }
    if (tracker->count == 2 && tracker->chi2[1] < tracker->chi2[0]) { // the more likely one first
        struct pose_kalman k = tracker->filters[0];
        double chi2 = tracker->chi2[0];
        tracker->filters[0] = tracker->filters[1], tracker->chi2[0] = tracker->chi2[1];
        tracker->filters[1] = k, tracker->chi2[1] = chi2;
    }
    return agrees;
}

static void fill_result(const struct camera_tracker *tracker, const struct location *found, struct location *out,
                        struct camera_motion *motion)
{
    const struct pose_kalman *k = &tracker->filters[0];
    *out = *found;
    out->world_from_camera = k->world_from_camera;
    out->other = tracker->filters[tracker->count == 2].world_from_camera;
    for (int i = 0; i < 36; i++)
        out->covariance[i] = k->covariance[i / 6][i % 6] + found->covariance[i] - found->noise[i];
    out->position_sigma_m = sqrt(out->covariance[21] + out->covariance[28] + out->covariance[35]);
    *motion = (struct camera_motion){tracker->time_ns, k->world_from_camera,
                                     v3(k->velocity[3], k->velocity[4], k->velocity[5]),
                                     v3(k->velocity[0], k->velocity[1], k->velocity[2])};
}

// The standard deviation of predicted positions in the image, pixels.
static double predicted_sigma_px(const struct camera_tracker *tracker)
{
    const struct pose_kalman *k = &tracker->filters[0];
    const struct lens *lens = locator_lens(tracker->locator);
    return fmax(lens->fx, lens->fy) * sqrt(fmax(k->covariance[0][0], k->covariance[1][1]));
}

// The filter's velocity as the prior while the image is read.
static void set_motion_prior(struct camera_tracker *tracker)
{
    const struct pose_kalman *k = &tracker->filters[0];
    double covariance[36];
    for (int i = 0; i < 36; i++)
        covariance[i] = k->covariance[6 + i / 6][6 + i % 6];
    locator_set_motion_prior(tracker->locator, k->velocity, covariance);
}

// Updates the filters by the image's pose.
static enum status finish_frame(struct camera_tracker *tracker, const struct location *found, bool ambiguous,
                                struct location *out, struct camera_motion *motion)
{
    tracker->since_seen_s = 0;
    tracker->tracked = tracker->count == 1 ? tracker->tracked + 1 : 0;
    if (!tracker->count || !update_filters(tracker, found, ambiguous))
        start_filters(tracker, found, ambiguous);
    fill_result(tracker, found, out, motion);
    return tracker->count == 2 ? AMBIGUOUS : OK;
}

enum status camera_tracker_track(struct camera_tracker *tracker, const uint8_t *color, const uint16_t *depth,
                                 int64_t time_ns, struct location *out, struct camera_motion *motion)
{
    struct location found;
    if (tracker->started && time_ns <= tracker->time_ns)
        return fail(ERR_ORDER, "an image's time must be later than that of the one before");
    double seconds = tracker->started ? (double)(time_ns - tracker->time_ns) * 1e-9 : 0;
    tracker->started = true;
    tracker->time_ns = time_ns;
    tracker->since_seen_s += seconds;
    if (tracker->since_seen_s > LOST_S)
        tracker->count = 0;
    for (int i = 0; i < tracker->count; i++)
        pose_kalman_predict(&tracker->filters[i], seconds);
    const bool rolling = locator_lens(tracker->locator)->readout_s > 0; // given, or detected since
    tracker->without_prior = tracker->count != 1 || (rolling && tracker->tracked == VELOCITY_FRAMES) ||
                             predicted_sigma_px(tracker) > MAX_PREDICTED_SIGMA_PX;
    if (tracker->without_prior)
        return NOTHING;
    set_motion_prior(tracker);
    enum status status = locator_track(tracker->locator, color, depth, tracker->filters[0].world_from_camera, &found);
    return status == OK ? finish_frame(tracker, &found, false, out, motion) : status;
}

enum status camera_tracker_localize(struct camera_tracker *tracker, const uint8_t *color, const uint16_t *depth,
                                    struct location *out, struct camera_motion *motion)
{
    struct location found;
    assert(tracker->started);
    if (tracker->count == 1)
        set_motion_prior(tracker);
    enum status status = tracker->without_prior ? locator_localize(tracker->locator, color, depth, &found)
                                                : locator_relocalize(tracker->locator, color, depth, &found);
    return status < 0 || status == NOTHING ? status : finish_frame(tracker, &found, status == AMBIGUOUS, out, motion);
}

enum status camera_tracker_process(struct camera_tracker *tracker, const uint8_t *color, const uint16_t *depth,
                                   int64_t time_ns, struct location *out, struct camera_motion *motion)
{
    enum status status = camera_tracker_track(tracker, color, depth, time_ns, out, motion);
    return status == NOTHING ? camera_tracker_localize(tracker, color, depth, out, motion) : status;
}

void camera_tracker_reset(struct camera_tracker *tracker)
{
    tracker->started = false;
    tracker->count = tracker->tracked = 0;
    tracker->since_seen_s = 0;
}

const struct lens *camera_tracker_lens(const struct camera_tracker *tracker) { return locator_lens(tracker->locator); }

bool camera_tracker_focal_is_wrong(const struct camera_tracker *tracker, double *scale)
{
    return locator_focal_is_wrong(tracker->locator, scale);
}

int32_t camera_tracker_moved_tags(const struct camera_tracker *tracker, int32_t *first)
{
    return locator_moved_tags(tracker->locator, first);
}
