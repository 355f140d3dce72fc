// Input of the stage "views": a take with estimated joints and the same take with the true ones, and images of the room
// with and without the person, from known poses.
#pragma once
#include "recording/recording.h"
#include "tests/bench/bench.h"
#include "tests/support/scratch.h"

enum { VIEWS_MAX = 128 };

struct views_image {
    int64_t since_ns;         // of the take's first frame
    uint8_t *room, *expected; // RGB: without the person, and with
    uint8_t *mask;            // not 0: the person
    struct pose found, truth; // world_from_camera in the place's axes: estimated, and true relative to the sensor
    bool placed;              // localised
    double angle_deg;         // between the sensor's and this view of the person, from above
};

struct views_data {
    struct scratch scratch;
    struct recording *recording;
    struct take *own, *true_take; // with our joints, with the true ones
    struct lens lens;             // of the images
    struct views_image image[VIEWS_MAX];
    int count;
    bool is_shared; // closed when the program ends
};

// folder NULL: renders the small world, brief: three seconds of it, once for all stages. Else as bench_folder.h says.
// On error *data must be closed too.
MUST_CHECK enum status views_data_open(struct views_data *data, const char *folder, bool brief);
void views_data_close(struct views_data *data);

// ---- bench_views_score.c
// The share of the two silhouettes' union that only one covers, percent; extra: psnr over the union, over the
// intersection, the share missing, the share that is too much. rgb, alpha: as drawn for `p`.
void views_judge(const struct views_data *data, const struct views_image *p, const uint8_t *rgb, const uint8_t *alpha,
                 struct bench_measure *out);
// The take's frame nearest to this time since its first.
int64_t views_nearest_frame(const struct take *take, int64_t since_ns);
